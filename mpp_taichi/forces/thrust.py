"""The thrust of a rocket."""

import math

import taichi as ti

from mpp_taichi.component import Particles, Vector, component, param
from mpp_taichi.forces._base import ExternalForce, is_among
from mpp_taichi.types import Template


@component
class Thrust(ExternalForce):
    """Thrust of a rocket that burns fuel: a = u q / (m − q (t − t₀)), from t₀ on, until the fuel is gone.

    m, the particle's mass in the scene, is that at t₀ and stays: what has burnt is taken off here, so that a rocket's own
    gravity should be of no account. Burnt out at m_e, it has gained u log(m / m_e) of speed. In a timeline, flow: 0 shuts the
    engine off, and the next burn sets the mass that is left, direction and start. Ignition and burn-out within a phase are
    wrong by a part of a step; where a phase begins they are exact. The work in the energy balance is that on m.
    Source: Tsiolkovsky (1903); Goldstein, Classical Mechanics (1980), §1, problem 13.
    """

    exhaust_speed: float = param(minimum=0.0, slider=True, unit="length time⁻¹", help="u, against the rocket")
    flow: float = param(
        minimum=0.0, strength=True, slider=True, unit="mass time⁻¹", help="q, fuel burnt in a unit of time; 0: off"
    )
    direction: Vector = param(help="of the push, any length")
    start: float = param(0.0, unit="time", help="t₀, ignition")
    empty_mass: float = param(0.0, minimum=0.0, unit="mass", help="m_e, at which the fuel is gone")
    of: Particles = param(None, optional=True, help="the rocket or the group of them; absent: every particle")
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
