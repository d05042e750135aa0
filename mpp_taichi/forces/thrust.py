"""The thrust of a rocket."""

import math

import taichi as ti

from mpp_taichi.component import Particles, Vector, component, param
from mpp_taichi.forces._base import ExternalForce, is_among
from mpp_taichi.types import Template


@component
class Thrust(ExternalForce):
    """Thrust of a rocket that burns fuel: a = u q / (m − q (t − t₀)), from t₀ on, until the fuel is gone.

    m, the particle's mass in the scene, is the mass at t₀ and stays constant: only this force subtracts the burnt fuel, so that
    the gravity of the rocket itself should be negligible. When its mass reaches m_e, the rocket has gained the speed
    u log(m / m_e). In a timeline, flow: 0 shuts the engine off, and the next burn sets the remaining mass, the direction and
    the start. Ignition and burn-out within a phase are wrong by a part of a step; at the start of a phase they are exact. The
    work in the energy balance is the work on the mass m.
    Source: Tsiolkovsky (1903); Goldstein, Classical Mechanics (1980), §1, problem 13.
    """

    exhaust_speed: float = param(
        minimum=0.0, slider=True, unit="length time⁻¹", help="speed u of the exhaust relative to the rocket"
    )
    flow: float = param(
        minimum=0.0,
        strength=True,
        slider=True,
        unit="mass time⁻¹",
        help="mass q of fuel burnt in a unit of time; 0: engine off",
    )
    direction: Vector = param(help="direction of the thrust, a vector of any length")
    start: float = param(0.0, unit="time", help="time t₀ of the ignition")
    empty_mass: float = param(0.0, minimum=0.0, unit="mass", help="mass m_e of the rocket without fuel")
    of: Particles = param(None, optional=True, help="the rocket or a group of rockets; absent: every particle")
    needs = frozenset({"mass"})
    has_derivatives = True
    conserves_energy = False
    depends_on_time = True

    @property
    def heading(self) -> tuple[float, ...]:
        """The direction at unit length; nowhere for no direction."""
        length = math.hypot(*self.direction)
        return tuple(component / length if length > 0.0 else 0.0 for component in self.direction)

    @property
    def drives_some(self) -> bool:
        """Whether there are particles that are no rockets."""
        return self.of is not None

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """u q / (m − q τ) along the direction where particle i is a rocket that burns."""
        return self.push(state, i, time, 1.0, 1)

    @ti.func
    def derivatives(self, state: Template, i, time):
        """u q² / (m − q τ)² and 2 u q³ / (m − q τ)³."""
        return self.push(state, i, time, self.flow, 2), self.push(state, i, time, 2.0 * self.flow * self.flow, 3)

    @ti.func
    def push(self, state: Template, i, time, factor, power: ti.template()):
        """factor u q / (m − q τ)^power along the direction."""
        result = ti.Vector.zero(float, state.dimensions)
        burnt = self.flow * (time - self.start)
        left = state.mass[i] - burnt
        if is_among(state, i, self.drives_some, self.of) and burnt >= 0.0 and left > self.empty_mass:
            size = factor * self.exhaust_speed * self.flow
            for _ in ti.static(range(power)):
                size /= left
            result = size * ti.Vector([self.heading[k] for k in range(state.dimensions)], float)
        return result

    @ti.func
    def potential(self, state: Template, i, time):
        """None."""
        return ti.cast(0.0, state.wide)
