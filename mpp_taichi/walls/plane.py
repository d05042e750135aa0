"""A plane that may move."""

from mpp_taichi.component import LawVector, Turning, Vector, component, param
from mpp_taichi.walls._base import Enclosure, Surface, Wall, motion_law, turning_law, unit_vector


@component
class Plane(Wall):
    """Infinite plane, particles on the side to which its normal points; with a velocity or a motion the plane is a piston.

    A moving plane does work: the particles' energy is not kept.
    """

    point: Vector = param(unit="length", help="any point of the plane, when the time is 0")
    normal: Vector = param(help="direction into the free side, of any length")
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹", help="velocity of the plane")
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
        """One plane."""
        surface = Surface(
            kind="plane",
            point=self.point,
            direction=unit_vector(self.normal, "normal"),
            radius=0.0,
            inside=True,
            velocity=self.velocity,
            restitution=self.restitution,
            label=label,
            temperature=self.temperature,
            seed=self.seed,
            motion=motion_law(self.motion),
            turning=turning_law(self.turning),
            friction=self.friction,
        )
        return Enclosure((surface,))
