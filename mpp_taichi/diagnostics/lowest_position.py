"""Lowest turning point of a coordinate."""

import math

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.diagnostics._between_looks import Track, coordinate
from mpp_taichi.snapshot import Snapshot


@component
class LowestPosition(Diagnostic):
    """Smallest value that one coordinate of one particle takes during the run [length]."""

    of: Particle = param(help="the particle")
    axis: str = param("z", choices=("x", "y", "z"), help="the coordinate")
    _track: Track | None = None
    _lowest: float = math.inf

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Look between this look and the last one, too."""
        value, rate = coordinate(snapshot, self.of, self.axis)
        self._track = self._track or Track(value)
        self._track.add(time, value, rate)
        self._lowest = min(self._lowest, self._track.lowest() if len(self._track.looks) == 2 else value)

    @property
    def interval(self) -> float:
        """Often enough for the cubic."""
        return self._track.interval if self._track else 0.0

    def result(self) -> float:
        """The coordinate there."""
        if self._track is None:
            raise NoResultError("the run was never looked at")
        return self._lowest
