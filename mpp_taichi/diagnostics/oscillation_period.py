"""Period of a coordinate that swings about a level."""

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.diagnostics._track import Track
from mpp_taichi.quantities._base import NoResultError, RunSample
from mpp_taichi.quantities.position import Position


@component
class OscillationPeriod(Diagnostic):
    """Mean period of one coordinate of one particle: from its first upward passage of a level to its last.

    Passages are found between samples by a cubic through values and rates, to 1e-7 of a period.
    """

    of: Particle = param(help="the particle")
    axis: str = param(choices=("x", "y", "z"), help="the coordinate")
    about: float = param(0.0, unit="length", help="the coordinate about which the particle swings")
    _track: Track | None = None
    _passages: tuple[float, ...] = ()

    def observe(self, sample: RunSample) -> None:
        """Note an upward passage since the sample before."""
        position = Position(of=(self.of, 1), axis=self.axis)
        self._track = self._track or Track(0.0)
        self._track.add(sample.time, position.measure(sample) - self.about, position.rate(sample))
        samples = self._track.samples
        if len(samples) == 2 and samples[0][1] < 0.0 <= samples[1][1]:
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
