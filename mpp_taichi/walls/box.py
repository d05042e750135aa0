"""A box with straight walls."""

from mpp_taichi.component import LawVector, Turning, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.walls._base import Enclosure, Surface, Wall, motion_law, turning_law

AXES = "xyz"


@component
class Box(Wall):
    """Rectangular box around the particles, a plane on each side; in two dimensions the box has four sides.

    A box that moves, or is shaken, does work: the particles' energy is not kept.
    """

    lower: Vector = param(unit="length", help="corner where every coordinate is least")
    upper: Vector = param(unit="length", help="corner where every coordinate is greatest")
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹", help="velocity of the box")
    motion: LawVector = param(
        None, optional=True, names=("t",), unit="length", help="displacement from there as a formula of the time for each axis"
    )
    turning: Turning = param(
        None, optional=True, names=("t",), help="angle as a formula of the time, about a point and in space about an axis [rad]"
    )
    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="restitution e of a bounce")
    friction: float = param(0.0, minimum=0.0, help="coefficient μ of the friction on spheres that slide along the wall")
    temperature: float = param(
        None, optional=True, minimum=0.0, unit="energy", help="k T with which spheres leave a thermal wall; absent: they bounce"
    )
    seed: int = param(1, minimum=0, maximum=4294967295, help="number that chooses the velocities after a thermal wall")

    def enclosure(self, dimensions: int, label: str) -> Enclosure:
        """Two planes for each axis."""
        surfaces = []
        for axis in range(dimensions):
            if not self.upper[axis] > self.lower[axis]:
                extent = f"from {self.lower[axis]:g} to {self.upper[axis]:g}"
                raise PlacementError(f"goes {extent} along {AXES[axis]}, upper must be greater than lower")
            for side, corner, sign in (("lower", self.lower, 1.0), ("upper", self.upper, -1.0)):
                normal = (sign * (axis == 0), sign * (axis == 1), sign * (axis == 2))
                surfaces.append(
                    Surface(
                        kind="plane",
                        point=corner,
                        direction=normal,
                        radius=0.0,
                        inside=True,
                        velocity=self.velocity,
                        restitution=self.restitution,
                        label=f"{label}, {side} {AXES[axis]}",
                        temperature=self.temperature,
                        seed=self.seed,
                        motion=motion_law(self.motion),
                        turning=turning_law(self.turning),
                        friction=self.friction,
                    )
                )
        return Enclosure(tuple(surfaces))
