"""One particle, with every property given; its place is a position, an orbit around a particle, or a path in time."""

from collections.abc import Iterable, Mapping
from itertools import takewhile
from typing import Any

import numpy as np

from mpp_taichi.arithmetic.orbital_elements import attraction
from mpp_taichi.component import Axes, Color, Law, LawVector, Particle, Vector, component, marked, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group
from mpp_taichi.generators._orbit import on_orbit, true_anomaly_at

_COPIED = ("velocity", "mass", "radius", "charge", "color", "free", "name")
_FACTORS = ("mass_factor", "charge_factor")
_OF_ORBIT = ("around", "semi_major_axis", "true_anomaly", "mean_anomaly")
_ANGLES = ("eccentricity", "inclination", "ascending_node", "argument_of_pericentre")


def _has_position_only(given: Mapping[str, Any]) -> bool:
    """Whether the parameters of a body give its position, and nothing of an orbit."""
    of_orbit = any(given[key] is not None for key in _OF_ORBIT) or any(given[key] != 0.0 for key in _ANGLES)
    changes = any(given[key] is not None for key in ("path", *_FACTORS))
    return given["position"] is not None and not changes and not of_orbit


@component
class Body(Generator):
    """One particle, at a position, on an orbit around a particle placed before, or on a path that is given as a formula.

    With `around` and `semi_major_axis` in place of a position, the two bodies begin a Kepler orbit around each other, with G of
    newtonian_gravity and both masses; softening and all other bodies are left out. A given velocity is added to the velocity of
    the orbit. The plane of reference is x–y, the direction of reference x.

    With a `path` the body is at x(t), and has the velocity x′(t), at every time t, and no force moves it; other particles feel
    it. The formulas may use the time t and the constants of the scene. The energy balance books the work of the agent that
    moves the body, of the power (m x″ − F)·x′, with F the force of all other particles and of the fields on it. Works with the
    integrators that are made of drifts and kicks, whose order it keeps; refused beside contacts, a periodic box and
    `move_to_center_of_mass`, with quantities that need a tangent, for copies side by side, and in f32c, ds and df64.

    With a `mass_factor` f or a `charge_factor` g, formulas of t, the mass is m f(t) and the charge q g(t). The mass that the
    body loses leaves with the velocity of the body, so that there is no recoil: dv/dt = F/m(t). The energy balance books the
    change of the energy as work. Works and is refused where a path works and is refused.
    """

    one_particle = True
    takes_path = True

    name: str = param("", help="name of the particle; absent: the scene refers to it by its index")
    mass: float = param(minimum=0.0, unit="mass")
    position: Vector = param(
        None, optional=True, unit="length", help="position; with a displacement: position at rest; absent: an orbit"
    )
    displacement: Vector = param(
        (0.0, 0.0, 0.0), unit="length", help="displacement from rest at the start; it stretches the springs"
    )
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹")
    path: LawVector = param(
        None,
        optional=True,
        names=("t",),
        unit="length",
        help="x(t) for each axis, in place of a position and a velocity, such as 0.1*sin(w*t)",
    )
    around: Particle = param(None, optional=True, help="primary body of an orbit, placed before this body")
    semi_major_axis: float = param(
        None, optional=True, unit="length", help="semi-major axis a of an orbit; below 0 for a hyperbola"
    )
    eccentricity: float = param(0.0, minimum=0.0, help="eccentricity e of an orbit")
    inclination: float = param(0.0, help="inclination i of an orbit to the x–y plane, in radians: radians(30)")
    ascending_node: float = param(0.0, help="longitude Ω of the ascending node of an orbit")
    argument_of_pericentre: float = param(0.0, help="argument ω of an orbit, the angle from the node to the pericentre")
    true_anomaly: float = param(
        None, optional=True, help="true anomaly f, the angle from the pericentre to the body; absent: 0"
    )
    mean_anomaly: float = param(None, optional=True, help="mean anomaly M, in place of the true anomaly")
    radius: float = param(0.0, minimum=0.0, unit="length", help="radius for contacts and the picture")
    charge: float = param(0.0, unit="charge")
    mass_factor: Law = param(
        None, optional=True, names=("t",), help="the mass at the time t, divided by `mass`, such as exp(-t/10)"
    )
    charge_factor: Law = param(
        None, optional=True, names=("t",), help="the charge at the time t, divided by `charge`, such as cos(w*t)"
    )
    color: Color = param((0.9, 0.9, 0.9), help="red, green, blue in 0…1")
    free: Axes = param(
        (True, True, True), help="false for an axis along which the particle is held; a velocity along it is ignored"
    )

    def particle_count(self) -> int:
        """One."""
        return 1

    @classmethod
    def at_once(cls, entries: Iterable[Mapping[str, Any]]) -> Group | None:
        """The bodies up to the first that is on an orbit."""
        there = list(takewhile(_has_position_only, entries))
        if not there:
            return None
        columns = {key: [each[key] for each in there] for key in _COPIED}
        rest = np.array([each["position"] for each in there], float)
        displaced = np.add(rest, [each["displacement"] for each in there])
        return make_group(len(there), position=displaced, rest_position=rest, **columns)

    def generate(self, context: GeneratorContext) -> Group:
        """Put the particle at its position."""
        position, velocity = self._place(context)
        return make_group(
            1,
            position=np.add(position, self.displacement),
            rest_position=position,
            velocity=velocity,
            mass=self.mass * _at_start(self.mass_factor),
            radius=self.radius,
            charge=self.charge * _at_start(self.charge_factor),
            color=self.color,
            free=(False, False, False) if self.path is not None else self.free,
            name=(self.name,),
        )

    def _place(self, context: GeneratorContext) -> tuple[np.ndarray, np.ndarray]:
        velocity = np.array(self.velocity, float)
        if self.path is not None:
            return self._on_path()
        if self.semi_major_axis is None:
            named = [name for name in _OF_ORBIT if getattr(self, name) is not None]
            named += [name for name in _ANGLES if getattr(self, name) != 0.0]
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
        mu = attraction(context.strength, (primary.mass, not primary.held), (self.mass * _at_start(self.mass_factor), True))
        if not mu > 0.0:
            forces = ", ".join(marked("forces", "gravitates"))
            raise PlacementError(f"an orbit needs {forces}, and a mass that attracts")
        anomaly = self.true_anomaly or 0.0
        if self.mean_anomaly is not None and self.eccentricity != 1.0:
            anomaly = true_anomaly_at(self.mean_anomaly, self.eccentricity)
        x, v = on_orbit(
            mu,
            self.semi_major_axis,
            self.eccentricity,
            self.inclination,
            self.ascending_node,
            self.argument_of_pericentre,
            anomaly,
        )
        return primary.position + x, primary.velocity + v + velocity

    def _on_path(self) -> tuple[np.ndarray, np.ndarray]:
        """Place and velocity at time 0 on the path; whatever else would place the body is refused."""
        given = [name for name in ("position", *_OF_ORBIT) if getattr(self, name) is not None]
        given += [name for name in ("velocity", "displacement", *_ANGLES) if np.any(np.not_equal(getattr(self, name), 0.0))]
        given += [] if all(self.free) else ["free"]
        if given:
            raise PlacementError(
                f"has a path and {given[0]}: the path says where the body is at all times, leave one of them out"
            )
        from mpp_taichi.scene.formulas.path_law import path_law  # with SymPy, only where there is a path

        return path_law(self.path).at(0.0)


def _at_start(factor: Any) -> float:
    """A factor of a mass or a charge at the time 0; 1 where there is none."""
    if factor is None:
        return 1.0
    from mpp_taichi.scene.formulas.path_law import path_law  # with SymPy, only where there is a factor

    return float(path_law((factor,)).at(0.0)[0][0])
