"""The direction in which a particle is seen from another."""

import math

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import ManySample, Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import center_of

PLANES = {"x": (1, 2), "y": (0, 2), "z": (0, 1)}
"""For each axis across a plane, the two axes in it; angles count from the first towards the second."""


@component
class Angle(Quantity):
    """Angle in −π…π at which a particle is seen from another particle, or from the origin, in a plane [radians].

    In the plane across z the angle counts from the x axis towards y, across y from x towards z, and across x from y towards z.
    """

    takes_many = True

    of: Particles = param(help="a particle or a group")
    around: Particles = param(
        None, optional=True, help="particle or group from which the angle is measured; absent: the origin"
    )
    axis: str = param("z", choices=("x", "y", "z"), help="axis perpendicular to the plane of the angle")
    zero: float = param(
        0.0, unit="radians", help="angle subtracted before the result is brought into −π…π; −pi/2 for a pendulum"
    )

    def label(self, setting: Setting) -> str:
        """`angle of planet around sun`."""
        around = setting.name_of(self.around)
        return of_which("angle", setting.name_of(self.of)) + (f" around {around}" if around else "")

    def measure(self, sample: RunSample) -> float:
        """The angle."""
        way = self._way(sample)
        first, second = PLANES[self.axis]
        return math.remainder(math.atan2(way[second], way[first]) - self.zero, math.tau)

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The angle in each copy, by the functions of `measure`, so that its bits are the same."""
        first, second = PLANES[self.axis]
        ways = self._way(many)[:, [second, first]].tolist()
        return np.array([math.remainder(math.atan2(*way) - self.zero, math.tau) for way in ways])

    def _way(self, sample: RunSample | ManySample) -> np.ndarray:
        """From the one particle to the other."""
        place = sample.snapshot.position
        way = center_of(place, sample.snapshot, self.of)
        return way if self.around is None else way - center_of(place, sample.snapshot, self.around)
