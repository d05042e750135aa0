"""A cylinder."""

from mpp_taichi.component import LawVector, Turning, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.walls._base import Enclosure, Surface, Wall, motion_law, turning_law, unit_vector


@component
class Cylinder(Wall):
    """Infinite cylinder, particles inside it or outside; in two dimensions a circle.

    A moving cylinder does work: the particles' energy is not kept. A cylinder that turns about its axis drags spheres by its
    friction.
    """

    point: Vector = param(unit="length", help="any point of the axis")
    axis: Vector = param(None, optional=True, help="direction of the axis, of any length; absent, and in two dimensions: z")
    radius: float = param(above=0.0, unit="length")
    inside: bool = param(True, help="whether the particles are inside")
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹", help="velocity of the cylinder")
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
        """One cylinder."""
        if dimensions == 2 and self.axis is not None:
            raise PlacementError("has an axis, but in a scene of dimensions: 2 it is a circle")
        axis = unit_vector(self.axis or (0.0, 0.0, 1.0), "axis")
        surface = Surface(
            kind="cylinder",
            point=self.point,
            direction=axis,
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
