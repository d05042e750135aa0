"""A sphere."""

from mpp_taichi.component import LawVector, Turning, Vector, component, param
from mpp_taichi.walls._base import Enclosure, Surface, Wall, motion_law, turning_law


@component
class Sphere(Wall):
    """Hollow sphere around the particles, or a solid sphere that keeps them outside; in two dimensions a circle.

    A moving sphere does work: the particles' energy is not kept. A sphere that turns about its centre drags spheres by its
    friction.
    """

    center: Vector = param(unit="length")
    radius: float = param(above=0.0, unit="length")
    inside: bool = param(True, help="whether the particles are inside")
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹", help="velocity of the sphere")
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
        """One sphere."""
        surface = Surface(
            kind="sphere",
            point=self.center,
            direction=(0.0, 0.0, 1.0),
            radius=self.radius,
            inside=self.inside,
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
