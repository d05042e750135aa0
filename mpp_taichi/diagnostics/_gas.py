"""What the diagnostics of gases share: totals that grow along a run, and which particles and which room they are of."""

import math
from dataclasses import dataclass, field

import numpy as np

from mpp_taichi.component import Particles
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.scene.contacts import merges
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.contact_setup import enclosure_of
from mpp_taichi.walls._base import Enclosure

BLOCKS = 10


@dataclass
class Total:
    """A total that grows along a run, kept at every look: its mean rate, and how well that is known."""

    times: list[float] = field(default_factory=list)
    totals: list[float] = field(default_factory=list)

    def add(self, time: float, total: float) -> None:
        """Keep a look; a second one at the same time replaces the first."""
        if self.times and self.times[-1] == time:
            self.totals[-1] = total
        else:
            self.times.append(time)
            self.totals.append(total)

    def rate(self) -> float:
        """Growth over time, from the first look to the last; NoResultError where there is no time between them."""
        if len(self.times) < 2:
            raise NoResultError("there are no two looks to measure a rate between: run longer, or begin earlier than `after`")
        return (self.totals[-1] - self.totals[0]) / (self.times[-1] - self.times[0])

    def standard_error(self) -> float | None:
        """Of the rate: scatter of the rates of ten blocks of equal looks, over √10; None with fewer than ten intervals.

        Right when a block is longer than the memory of what is counted, which is some collisions per particle.
        """
        if len(self.times) <= BLOCKS:
            return None
        edges = np.linspace(0, len(self.times) - 1, BLOCKS + 1).astype(int)
        rates = np.diff(np.array(self.totals)[edges]) / np.diff(np.array(self.times)[edges])
        return float(np.std(rates, ddof=1) / math.sqrt(BLOCKS))


class OfContacts(Diagnostic):
    """Follows the contact solver's counts from `after` on; subclasses declare `after` and come to their number."""

    after: float
    _dimensions: int = 3
    _report: ContactReport | None = None

    def begin(self, spec: SceneSpec, start: Snapshot) -> None:
        """See that there are contacts."""
        if spec.contacts is None:
            raise NoResultError("the scene has no contacts")
        self._dimensions = spec.dimensions
        self._total = Total()

    def observe_contacts(self, time: float, report: ContactReport) -> None:
        """Keep the count."""
        self._report = report
        if time >= self.after:
            self._total.add(time, self.counted(report))

    def counted(self, report: ContactReport) -> float:
        """What is added up."""
        raise NotImplementedError

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Nothing but the count is needed."""


def require_no_merging(spec: SceneSpec) -> None:
    """NoResultError where spheres merge."""
    if merges(spec):
        raise NoResultError("spheres become fewer as they merge, so that there is no number of collisions for each")


def rows_of(of: Particles | None, snapshot: Snapshot) -> np.ndarray:
    """Indices of the particles of a group, or of all, that are free along every axis."""
    rows = np.arange(snapshot.particle_count) if of is None else np.arange(of[0], of[0] + of[1])
    return rows[snapshot.free[rows].all(axis=1)]


def box_of(spec: SceneSpec) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box that the walls of a scene make, or that repeats, (dimensions,) each [length].

    Raises:
        NoResultError: they make no box with walls across the axes, or it changes.
    """
    enclosure = enclosure_of(spec)
    lower, upper = np.full(spec.dimensions, -math.inf), np.full(spec.dimensions, math.inf)
    for surface in enclosure.surfaces:
        axes = [axis for axis in range(spec.dimensions) if surface.direction[axis] != 0.0]
        if surface.kind != "plane" or len(axes) != 1 or any(surface.velocity):
            raise NoResultError(f"{surface.label} is no wall of a box that stays as it is, so that there is no volume known")
        axis = axes[0]
        if surface.direction[axis] > 0.0:
            lower[axis] = max(lower[axis], surface.point[axis])
        else:
            upper[axis] = min(upper[axis], surface.point[axis])
    _repeat(enclosure, lower, upper)
    if not np.all(np.isfinite(upper - lower)):
        raise NoResultError("the walls are open, so that there is no volume known")
    return lower, upper


def _repeat(enclosure: Enclosure, lower: np.ndarray, upper: np.ndarray) -> None:
    for axis in range(len(lower)):
        if enclosure.repeats[axis]:
            lower[axis] = enclosure.origin[axis]
            upper[axis] = enclosure.origin[axis] + enclosure.period[axis]
