"""The distance of two particles, or of a particle from a point or from the centre of mass."""

import numpy as np

from mpp_taichi.component import Pair, Particles, Vector, component, param
from mpp_taichi.quantities._base import ManySample, NoResultError, OfEach, RunSample, Setting, of_which
from mpp_taichi.quantities._ends_of_distance import EndsOfDistance
from mpp_taichi.quantities._particles import lengths, rows

LARGEST_TURN = 0.1  # of the distance: farther the two ends may not move between two samples


@component
class Distance(OfEach):
    """Distance of a particle or a group's centre of mass from another, or from a point [length].

    Without `to` and `point` the distance is from the centre of mass of all particles. A histogram shows the distance of each
    particle. For the largest or smallest distance of a run, samples follow each other so fast that the two ends move by at most
    a tenth of it.
    """

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    to: Particles = param(None, optional=True, help="the other end of the distance: a particle or a group")
    point: Vector = param(None, optional=True, unit="length", help="the other end of the distance: a point")
    between: Pair = param(None, optional=True, help="two particles, in place of `of` and `to`")
    dimension = (1, 0, 0)
    has_rate = True
    takes_many = True
    _last: EndsOfDistance | None = None

    def begin(self, setting: Setting) -> None:
        """Check that there is one place to measure from."""
        if self.to is not None and self.point is not None:
            raise NoResultError("distance is either to: another particle or from a point:, not both")
        if self.between is not None and (self.of, self.to, self.point) != (None, None, None):
            raise NoResultError("distance is either between: two particles or of: a particle, not both")

    def label(self, setting: Setting) -> str:
        """`distance of b to post`."""
        if self.point is not None:
            end = "(" + ", ".join(f"{each:g}" for each in self.point[: setting.spec.dimensions]) + ")"
        else:
            end = setting.name_of(self._to) or "centre of mass"
        return f"{of_which('distance', setting.name_of(self._of))} to {end}"

    def measure(self, sample: RunSample) -> float:
        """The distance."""
        return float(np.linalg.norm(self._relative(sample).separation))

    def rate(self, sample: RunSample) -> float:
        """The part of the relative velocity along the separation; 0 where the two ends are at one place."""
        separation = self._relative(sample).separation
        distance = float(np.linalg.norm(separation))
        return float(separation @ self._relative(sample).motion) / distance if distance > 0.0 else 0.0

    def sampling_interval(self, sample: RunSample) -> float:
        """The time in which the ends move by `LARGEST_TURN` of their distance."""
        speed = float(np.linalg.norm(self._relative(sample).motion))
        return LARGEST_TURN * self.measure(sample) / speed if speed > 0.0 else np.inf

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The distance in each copy."""
        return lengths(self._relative(many).separation)

    def rate_many(self, many: ManySample) -> np.ndarray:
        """The rate in each copy."""
        separation, motion = self._relative(many).separation, self._relative(many).motion
        distance, along = lengths(separation), (separation * motion).T
        return np.where(distance > 0.0, (along[0] + along[1] + along[2]) / np.where(distance > 0.0, distance, 1.0), 0.0)

    def sampling_interval_many(self, many: ManySample) -> np.ndarray:
        """The interval of each copy."""
        speed = lengths(self._relative(many).motion)
        return np.where(speed > 0.0, LARGEST_TURN * self.measure_many(many) / np.where(speed > 0.0, speed, 1.0), np.inf)

    def each(self, sample: RunSample) -> np.ndarray:
        """The distances of all particles of the group."""
        return np.linalg.norm(sample.snapshot.position[rows(self._of)] - self._relative(sample).end, axis=1)

    @property
    def _of(self) -> tuple[int, int] | None:
        return self.of if self.between is None else (self.between[0], 1)

    @property
    def _to(self) -> tuple[int, int] | None:
        return self.to if self.between is None else (self.between[1], 1)

    def _relative(self, sample: RunSample | ManySample) -> EndsOfDistance:
        """The two ends in a sample, the same object as long as the same sample is asked for."""
        if self._last is None or self._last.sample is not sample:
            self._last = EndsOfDistance(sample, self._of, self._to, self.point)
        return self._last
