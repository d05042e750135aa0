"""A plane that may move."""

from mpp_taichi.component import Vector, component, param
from mpp_taichi.walls._base import Enclosure, Surface, Wall, unit_vector


@component
class Plane(Wall):
    """Infinite plane, particles on the side its normal points to; with a velocity it is a piston.

    A moving plane does work: the particles' energy is not kept.
    """

    point: Vector = param(unit="length", help="any point of the plane, when the time is 0")
    normal: Vector = param(help="direction into the free side, of any length")
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹", help="velocity of the plane")
    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="restitution e of a bounce")

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
        )
        return Enclosure((surface,))
