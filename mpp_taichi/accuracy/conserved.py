"""Errors of conserved quantities in a run: the largest difference from their values at the start of each phase.

A change of the timeline puts energy and momentum into the system, so that these quantities are compared within a phase, in each
phase that keeps them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mpp_taichi.accuracy.sample import Sample
from mpp_taichi.energy.energy_error import ratio, relative_error


@dataclass(eq=False)
class PhaseLooks:
    """The samples of mechanics in a phase, and the names of the quantities that the phase keeps."""

    kept: frozenset[str]
    rows: list[dict[str, Any]] = field(default_factory=list)


def judge(sample: Sample, phases: Sequence[PhaseLooks]) -> None:
    """Set the errors of a sample: of the energy, the momentum and the angular momentum, where some phase keeps them."""
    for phase in phases:
        if phase.rows:
            _judge(sample, phase)


def _judge(sample: Sample, phase: PhaseLooks) -> None:
    rows, first = phase.rows, phase.rows[0]
    if "energy" in phase.kept:
        largest = max(row["kinetic_energy"] + abs(row["potential_energy"]) for row in rows)
        start = first["total_energy"]
        sample.times += [row["time"] for row in rows]
        sample.energy_errors += [relative_error(row["total_energy"] - start, start, largest) for row in rows]
        sample.energy = max(sample.energy_errors)
    for name in sorted(phase.kept - {"energy"}):
        scale = max(row[f"{name}_scale"] for row in rows)
        found = max(ratio(float(np.linalg.norm(row[name] - first[name])), scale) for row in rows)
        setattr(sample, name, max(found, getattr(sample, name) or 0.0))
