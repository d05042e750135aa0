"""Shared parts of the diagnostics of gases: totals that grow along a run, and the box that holds the gas."""

import math
from abc import abstractmethod
from dataclasses import dataclass, field

import numpy as np

from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.quantities._base import NoResultError, RunSample, Setting
from mpp_taichi.quantities._contacts import require_contacts
from mpp_taichi.scene.contacts import merges
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.start.contact_setup import enclosure_of
from mpp_taichi.walls._base import Enclosure

BLOCKS = 10


@dataclass
class Total:
    """A total that grows along a run, kept in every sample: its mean rate, and the standard error of the rate."""

    times: list[float] = field(default_factory=list)
    totals: list[float] = field(default_factory=list)

    def add(self, time: float, total: float) -> None:
        """Keep a sample; a second sample at the same time replaces the first."""
        if self.times and self.times[-1] == time:
            self.totals[-1] = total
        else:
            self.times.append(time)
            self.totals.append(total)

    def rate(self) -> float:
        """Growth over time, from the first sample to the last; NoResultError where there is no time between them."""
        if len(self.times) < 2:
            raise NoResultError("there are no two samples to measure a rate between: run longer, or begin earlier than `after`")
        return (self.totals[-1] - self.totals[0]) / (self.times[-1] - self.times[0])

    def standard_error(self) -> float:
        """Error of the rate: the scatter of the rates of ten blocks of equally many samples, over √10.

        It is right when a block is longer than the gas remembers its past, which is some collisions per particle. The momentum
        given to walls needs longer blocks, since a part of it is the change of Σ r·v, which is bounded: for 24 disks the
        error is 1.7 times too long in blocks of 2.5 crossings of the box, and right in blocks of 40 crossings.

        Raises:
            NoResultError: there are fewer than ten intervals.
        """
        if len(self.times) <= BLOCKS:
            raise NoResultError("ten samples or fewer say nothing of their scatter")
        edges = np.linspace(0, len(self.times) - 1, BLOCKS + 1).astype(int)
        rates = np.diff(np.array(self.totals)[edges]) / np.diff(np.array(self.times)[edges])
        return float(np.std(rates, ddof=1) / math.sqrt(BLOCKS))


class OfContacts(Diagnostic):
    """Follows a number that the contact solver counts from `after` on; a subclass declares `after` and comes to its number."""

    after: float
    _dimensions: int = 3

    def begin(self, setting: Setting) -> None:
        """Check that the scene has contacts."""
        require_contacts(setting.spec)
        self._dimensions = setting.spec.dimensions
        self._total = Total()
        self.prepare(setting)

    def prepare(self, setting: Setting) -> None:
        """Keep the facts of the scene that the number needs; NoResultError where it is not defined."""

    def observe(self, sample: RunSample) -> None:
        """Keep the count, and the particles' part."""
        if sample.time >= self.after:
            self._total.add(sample.time, self.counted(sample.contact_report))
            self.take(sample)

    @abstractmethod
    def counted(self, report: ContactReport) -> float:
        """The number that grows along the run."""

    def take(self, sample: RunSample) -> None:
        """Keep the data of the particles that the number needs."""


def require_no_merging(spec: SceneSpec) -> None:
    """NoResultError where spheres merge."""
    if merges(spec):
        raise NoResultError("spheres become fewer as they merge, so that there is no number of collisions for each")


def box_of(spec: SceneSpec) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box that the walls of a scene make, or that repeats, (dimensions,) each [length].

    Raises:
        NoResultError: they make no box with walls across the axes, or it changes.
    """
    enclosure = enclosure_of(spec)
    lower, upper = np.full(spec.dimensions, -math.inf), np.full(spec.dimensions, math.inf)
    for surface in enclosure.surfaces:
        axes = [axis for axis in range(spec.dimensions) if surface.direction[axis] != 0.0]
        if surface.kind != "plane" or len(axes) != 1 or surface.moves:
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
