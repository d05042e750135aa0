"""A box that repeats."""

from mpp_taichi.component import Axes, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.walls._base import Enclosure, Wall


@component
class PeriodicBox(Wall):
    """Periodic boundary: a particle that leaves on one side comes in on the other, and feels the nearest copy of each particle.

    Spheres must be smaller than half of the shortest edge that repeats, and a cutoff of a pair force at most half of it. Pair
    forces without a cutoff are refused, as they would act on endless copies.
    """

    lower: Vector = param(unit="length", help="corner where every coordinate is least")
    upper: Vector = param(unit="length", help="corner where every coordinate is greatest")
    axes: Axes = param((True, True, True), help="false for an axis along which the box does not repeat")
    repeats = True

    def enclosure(self, dimensions: int, label: str) -> Enclosure:
        """A period, no surface."""
        period = [0.0, 0.0, 0.0]
        for axis in range(dimensions):
            if not self.axes[axis]:
                continue
            period[axis] = self.upper[axis] - self.lower[axis]
            if not period[axis] > 0.0:
                extent = f"from {self.lower[axis]:g} to {self.upper[axis]:g}"
                raise PlacementError(f"goes {extent} along {'xyz'[axis]}, upper must be greater than lower")
        if not any(period):
            raise PlacementError("repeats along no axis")
        return Enclosure((), (period[0], period[1], period[2]), self.lower)
