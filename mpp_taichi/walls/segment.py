"""A straight piece of wall."""

from mpp_taichi.component import LawVector, Turning, Vector, component, param
from mpp_taichi.walls._base import Enclosure, Wall, motion_law, segment, turning_law


@component
class Segment(Wall):
    """Straight wall between two points, with particles on both sides; particles also bounce off its ends, as off fixed points.

    In three dimensions the wall is a strip, infinite along z, above the segment in the x–y plane. A moving segment does work:
    the particles' energy is not kept.
    """

    from_: Vector = param(unit="length", help="one end, when the time is 0; a third component is without meaning")
    to: Vector = param(unit="length", help="the other end")
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹", help="velocity of the wall")
    motion: LawVector = param(
        None, optional=True, names=("t",), unit="length", help="displacement from there as a formula of the time for each axis"
    )
    turning: Turning = param(
        None, optional=True, names=("t",), help="angle as a formula of the time, about a point and in space about an axis [rad]"
    )
    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="restitution e of a bounce")
    friction: float = param(0.0, minimum=0.0, help="coefficient μ of the friction on spheres that slide along the wall")

    def enclosure(self, dimensions: int, label: str) -> Enclosure:
        """One segment."""
        made = segment(
            self.from_,
            self.to,
            velocity=self.velocity,
            restitution=self.restitution,
            label=label,
            motion=motion_law(self.motion),
            turning=turning_law(self.turning),
            friction=self.friction,
        )
        return Enclosure((made,))
