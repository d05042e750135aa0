"""Where a particle is at a time."""

import math

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.diagnostics._between_looks import Track, coordinate
from mpp_taichi.snapshot import Snapshot

ROUNDING = 1e-9  # of the time: the steps of a run need not add up to its end in the last bit


@component
class Position(Diagnostic):
    """One coordinate of one particle at a time [length].

    Where no step ends at that time it is the cubic through both values and both rates of the step around it (Hermite), good to
    a₂ dt⁴/384, a₂ the second derivative of the acceleration. At the end of the run it is `end_position`.
    """

    of: Particle = param(help="the particle")
    axis: str = param(choices=("x", "y", "z"), help="the coordinate")
    at: float = param(minimum=0.0, unit="time", help="when; the run must reach it")
    _track: Track | None = None

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Keep the last look before the time and the first from it on."""
        self._track = self._track or Track(0.0)
        if not self._track.looks or self._track.looks[-1][0] < self.at:
            self._track.add(time, *coordinate(snapshot, self.of, self.axis))

    @property
    def interval(self) -> float:
        """Until the time; the looks around it are then a step apart."""
        missing = self.at - self._track.looks[-1][0] if self._track else 0.0
        return missing if missing > 0.0 else math.inf

    def result(self) -> float:
        """The coordinate then."""
        if self._track is None:
            raise NoResultError("the run was never looked at")
        times = [look[0] for look in self._track.looks]
        if not times[0] <= self.at <= times[-1] * (1.0 + ROUNDING):
            raise NoResultError(f"the run was at times {times[0]:g} and {times[-1]:g}, not at {self.at:g}")
        if len(times) < 2:
            return self._track.looks[0][1]
        return self._track.value(min(1.0, (self.at - times[0]) / (times[1] - times[0])))
