"""A polygon, or a line of straight pieces."""

from mpp_taichi.component import LawVector, Points, Turning, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.walls._base import Enclosure, Wall, motion_law, segment, turning_law


@component
class Polygon(Wall):
    """Straight walls from point to point, with particles on both sides: a closed polygon, or an open line (`closed: false`).

    In three dimensions the walls are upright: strips, infinite along z, above the polygon in the x–y plane. A moving polygon
    does work: the particles' energy is not kept.
    """

    points: Points = param(unit="length", help="corners in order, when the time is 0; third components are without meaning")
    closed: bool = param(True, help="whether a wall leads from the last point back to the first")
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹", help="velocity of the walls")
    motion: LawVector = param(
        None, optional=True, names=("t",), unit="length", help="displacement from there as a formula of the time for each axis"
    )
    turning: Turning = param(
        None, optional=True, names=("t",), help="angle as a formula of the time, about a point and in space about an axis [rad]"
    )
    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="restitution e of a bounce")
    friction: float = param(0.0, minimum=0.0, help="coefficient μ of the friction on spheres that slide along the wall")

    def enclosure(self, dimensions: int, label: str) -> Enclosure:
        """A segment for each side."""
        fewest = 3 if self.closed else 2
        if len(self.points) < fewest:
            kind = "a closed polygon" if self.closed else "an open line"
            raise PlacementError(f"has {len(self.points)} points, {kind} needs {fewest} at least")
        ends = [*self.points[1:], self.points[0]] if self.closed else self.points[1:]
        motion, turning, sides = motion_law(self.motion), turning_law(self.turning), []
        for number, (begin, end) in enumerate(zip(self.points, ends)):
            name = f"{label}, side {number}"
            try:
                made = segment(
                    begin,
                    end,
                    velocity=self.velocity,
                    restitution=self.restitution,
                    label=name,
                    wall=label,
                    motion=motion,
                    turning=turning,
                    friction=self.friction,
                )
            except PlacementError as error:
                raise PlacementError(f"side {number} {error}") from None
            sides.append(made)
        return Enclosure(tuple(sides))
