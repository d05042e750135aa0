"""One particle, every property given; its place directly, or by the elements of its orbit."""

import numpy as np

from mpp_taichi.component import Axes, Color, Particle, Vector, component, marked, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group
from mpp_taichi.generators._orbit import on_orbit, true_anomaly_at


@component
class Body(Generator):
    """One particle, at a position, or on an orbit around a particle placed before.

    With `around` and `semi_major_axis` in place of a position, position and velocity are those of the Kepler orbit of the two,
    with G of newtonian_gravity and both masses; softening and all others are left out. The velocity that is given
    comes on top. The plane of reference is x–y, the direction of reference x.
    """

    name: str = param("", help="to refer to it by; otherwise it has its index")
    mass: float = param(minimum=0.0, unit="mass")
    position: Vector = param(None, optional=True, unit="length", help="with a displacement: that of rest; or say an orbit")
    displacement: Vector = param((0.0, 0.0, 0.0), unit="length", help="from rest, at the start; springs stretch by it")
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹")
    around: Particle = param(None, optional=True, help="of an orbit: the primary, placed before")
    semi_major_axis: float = param(None, optional=True, unit="length", help="of an orbit: a; below 0 for a hyperbola")
    eccentricity: float = param(0.0, minimum=0.0, help="of an orbit: e")
    inclination: float = param(0.0, help="of an orbit: i, to the x–y plane; angles are in radians: radians(30)")
    ascending_node: float = param(0.0, help="of an orbit: Ω, longitude of the ascending node")
    argument_of_pericentre: float = param(0.0, help="of an orbit: ω, from the node to the pericentre")
    true_anomaly: float = param(None, optional=True, help="of an orbit: f, from the pericentre to the body; absent: 0")
    mean_anomaly: float = param(None, optional=True, help="of an orbit: M, in place of f")
    radius: float = param(0.0, minimum=0.0, unit="length", help="for contacts and the picture")
    charge: float = param(0.0, unit="charge")
    color: Color = param((0.9, 0.9, 0.9), help="red, green, blue in 0…1")
    free: Axes = param((True, True, True), help="false where an axis is held fixed; a velocity along it is ignored")

    def particle_count(self) -> int:
        """One."""
        return 1

    def generate(self, context: GeneratorContext) -> Group:
        """Put the particle at its position."""
        position, velocity = self._place(context)
        return make_group(
            1,
            position=np.add(position, self.displacement),
            rest_position=position,
            velocity=velocity,
            mass=self.mass,
            radius=self.radius,
            charge=self.charge,
            color=self.color,
            free=self.free,
            name=(self.name,),
        )

    def _place(self, context: GeneratorContext) -> tuple[np.ndarray, np.ndarray]:
        velocity = np.array(self.velocity, float)
        if self.semi_major_axis is None:
            named = [name for name in ("around", "true_anomaly", "mean_anomaly") if getattr(self, name) is not None]
            angles = ("eccentricity", "inclination", "ascending_node", "argument_of_pericentre")
            named += [name for name in angles if getattr(self, name) != 0.0]
            if named:
                raise PlacementError(f"{named[0]} is of an orbit, which needs semi_major_axis too")
            if self.position is None:
                raise PlacementError("needs a position, or around and semi_major_axis of an orbit")
            return np.array(self.position, float), velocity
        if self.position is not None:
            raise PlacementError("has a position and a semi_major_axis: an orbit says where the body is, leave one of them out")
        if self.around is None:
            raise PlacementError("an orbit needs around: the particle that it is around, placed before")
        if self.true_anomaly is not None and self.mean_anomaly is not None:
            raise PlacementError("has a true_anomaly and a mean_anomaly, leave one of them out")
        primary = context.find(self.around)
        attraction = context.strength * (primary.mass + self.mass)
        if not attraction > 0.0:
            forces = ", ".join(marked("forces", "gravitates"))
            raise PlacementError(f"an orbit needs {forces}, and a mass that attracts")
        anomaly = self.true_anomaly or 0.0
        if self.mean_anomaly is not None and self.eccentricity != 1.0:
            anomaly = true_anomaly_at(self.mean_anomaly, self.eccentricity)
        x, v = on_orbit(
            attraction,
            self.semi_major_axis,
            self.eccentricity,
            self.inclination,
            self.ascending_node,
            self.argument_of_pericentre,
            anomaly,
        )
        return primary.position + x, primary.velocity + v + velocity
