"""Verdict of a run: the findings that make its results inaccurate, in words and numbers; the same for Python and commands."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.simulation import first_bad_step
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.overlaps import surface_depth
from mpp_taichi.wording.told_apart import told_apart

ENERGY_LIMIT = 0.1
"""Relative energy error above which a run of conservative forces is inaccurate: particles are then on other orbits."""
OVERLAP_LIMIT = 1.0
"""Radii of the smaller sphere: beyond it, the centre of the sphere was inside the other, which pushes it out anywhere."""
MISSED_LIMIT = ENERGY_LIMIT
"""Energy of bounces that a drift had no room for, over the energy that the contacts had to do with."""


@dataclass(frozen=True)
class RunFinding:
    """One reason why results are not accurate.

    kind      energy, massless, rounding, overlap or bounces
    message   one line with the numbers
    time      at which it was found [time]
    particle  that it is about; None where it is about all
    """

    kind: str
    message: str
    time: float
    particle: int | None = None

    def __str__(self) -> str:
        """The message."""
        return self.message


@dataclass(frozen=True)
class RunVerdict:
    """The judgement of a run so far: its findings, the first of each kind, in the order in which they were found."""

    findings: tuple[RunFinding, ...] = ()

    @property
    def is_sound(self) -> bool:
        """Whether nothing was found."""
        return not self.findings

    @property
    def status(self) -> str:
        """`ok`, or `inaccurate`."""
        return "ok" if self.is_sound else "inaccurate"

    def __str__(self) -> str:
        """One line for each finding, or `ok`."""
        return "\n".join(map(str, self.findings)) or self.status


def energy_finding(row: Mapping[str, Any]) -> RunFinding | None:
    """The finding for a sample whose energy was to be conserved: `relative_energy_error`, `time`, `conserves_energy`."""
    if not row["conserves_energy"] or row["relative_energy_error"] <= ENERGY_LIMIT:
        return None
    error, time = row["relative_energy_error"], f"at time {row['time']:.6g} although every force conserves it"
    wrong = f"off by {error:.2g} of itself {time}" if math.isfinite(error) else f"no finite number {time}"
    text = f"the energy was {wrong}: the results are not accurate; try a smaller dt, a better integrator or a softening"
    return RunFinding("energy", text, row["time"])


def wall_finding(setup: ContactSetup, snapshot: Snapshot) -> RunFinding | None:
    """The finding for a sphere that is deep in a wall, or behind it."""
    radius = snapshot.radius
    for surface in setup.enclosure.surfaces:
        depth, _ = surface_depth(surface, snapshot.position, radius, snapshot.time)
        deep = np.flatnonzero((radius > 0.0) & ~(depth <= OVERLAP_LIMIT * radius) & snapshot.free.any(axis=1))
        if len(deep):
            particle = int(deep[0])
            text = (
                f"{first_bad_step.label(snapshot, particle)} is {depth[particle] / radius[particle]:.3g} of its radii inside "
                f"{surface.label}: the results are not accurate; try a smaller dt, or another contact solver"
            )
            return RunFinding("overlap", text, snapshot.time, particle)
    return None


def contact_findings(report: ContactReport, kinetic_energy: float, time: float) -> list[RunFinding]:
    """The findings of the counts of the contacts; `kinetic_energy` is the largest that was seen in the run."""
    found = []
    if report.largest_overlap > OVERLAP_LIMIT:
        text = (
            f"spheres overlapped by up to {report.largest_overlap:.3g} radii of the smaller one, so that bounces went astray: "
            "the results are not accurate; try a smaller dt, or another contact solver"
        )
        found.append(RunFinding("overlap", text, time))
    scale = kinetic_energy + abs(report.dissipated_energy)
    if report.missed_energy > MISSED_LIMIT * scale:
        missed, whole = told_apart(report.missed_energy, scale, digits=3)
        text = (
            f"spheres met again within a drift, without a bounce, which took an energy of {missed}, and all "
            f"contacts had to do with {whole}: the results are not accurate; try a smaller dt, or the solver swept"
        )
        found.append(RunFinding("bounces", text, time))
    return found
