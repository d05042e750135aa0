"""Period of a coordinate that swings about a level."""

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.diagnostics._between_looks import Track, coordinate
from mpp_taichi.snapshot import Snapshot


@component
class OscillationPeriod(Diagnostic):
    """Mean period of one coordinate of one particle: from its first upward passage of a level to its last.

    Passages are found between looks by a cubic through values and rates, to 1e-7 of a period.
    """

    of: Particle = param(help="the particle")
    axis: str = param(choices=("x", "y", "z"), help="the coordinate")
    about: float = param(0.0, unit="length", help="the level it swings about")
    _track: Track | None = None
    _passages: tuple[float, ...] = ()

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Note the upward passages."""
        value, rate = coordinate(snapshot, self.of, self.axis)
        self._track = self._track or Track(0.0)
        self._track.add(time, value - self.about, rate)
        if len(self._track.looks) == 2 and self._track.looks[0][1] < 0.0 <= self._track.looks[1][1]:
            self._passages = (*self._passages, self._track.first_crossing(0.0))

    @property
    def interval(self) -> float:
        """Often enough for the cubic."""
        return self._track.interval if self._track else 0.0

    def result(self) -> float:
        """The period [time]."""
        if len(self._passages) < 2:
            text = f"{self.axis} of particle {self.of} rose through {self.about:g} {len(self._passages)} time(s), must twice"
            raise NoResultError(text)
        return (self._passages[-1] - self._passages[0]) / (len(self._passages) - 1)
