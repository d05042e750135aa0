"""General relativity between bodies that all move, to first order."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.inverse_distance import inverse_root
from mpp_taichi.arithmetic.particle_update import separation, velocity_seen, wide_position, wide_velocity
from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.forces._relativity_at_rest import RelativityAtRest
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template


@component
class EinsteinInfeldHoffmann(ExternalForce):
    """First post-Newtonian order between bodies that all move, whatever their masses are, beside `newtonian_gravity`.

    With d = x_j − x_i, u = 1/|d|, φ_i = Σ_k G m_k/r_ik and Newton's acceleration A_i = Σ_k G m_k d/r_ik³ of each body,

    c² a_i = Σ_j G m_j u³ d (½ d·A_j − 4 φ_i − φ_j + v_i² + 2 v_j² − 4 v_i·v_j − (3/2) u² (d·v_j)²)
           + Σ_j G m_j u³ (d·(4 v_i − 3 v_j)) (v_j − v_i) + (7/2) Σ_j G m_j u A_j.

    The pericentre of two bodies turns by 6π G (m₁ + m₂)/(c² a (1 − e²)) a revolution. The total energy is that of this order,

    E = Newton's + c⁻² Σ_i m_i ((3/8) v_i⁴ + ½ φ_i² + Σ_j G m_j u ((3/2) v_i² − (7/4) v_i·v_j − ¼ u² (d·v_i) (d·v_j))).

    It changes only by terms of c⁻⁴, and so does Σ m v (1 + (v² − φ)/(2 c²)) − ½ c⁻² ΣΣ G m_i m_j u³ d (d·v_i), which takes the
    place of the momentum Σ m v. Up to 128 bodies may act; Newton's accelerations are summed first, so that the work is O(N²).
    The bodies are points without spin, and none of them is held or driven.
    Source: A. Einstein, L. Infeld & B. Hoffmann, Ann. Math. 39 (1938) 65; F. Estabrook, JPL Section Report 33-3 (1971), in this
    form; L. Landau & E. Lifshitz, The Classical Theory of Fields (1975), §106, the Lagrangian of this energy and momentum.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    speed_of_light: float = param(above=0.0, unit="length time⁻¹", help="c")
    of: Particles = param(None, optional=True, help="the group of the bodies that act and feel; absent: every particle")
    needs = frozenset({"mass"})
    depends_on_velocity = True
    linear_in_velocity = False
    proportional_to_mass = True
    singular_at_zero_distance = True
    gathers = True
    needs_gravity = True
    mixes_velocities = True
    group = (0, 0)

    def see(self, start: Snapshot) -> None:
        """Take the first body and the number of the bodies."""
        self.group = self.of or (0, start.particle_count)

    def parts(self) -> tuple[ExternalForce, ...]:
        """The part of bodies at rest, which is summed once where velocities change, and the part of the velocities."""
        return RelativityAtRest(self), self

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """The part with velocities, where body i has this velocity."""
        return self.moving(state, state, ti.cast(0.0, float), i, velocity)

    @ti.func
    def acceleration_gained(self, state: Template, slopes: Template, h, i, time):
        """Change of the acceleration where the velocities of all bodies change."""
        before = velocity_seen(state, i)
        after = before + h * velocity_seen(slopes, i)
        return self.moving(state, slopes, h, i, after) - self.moving(state, slopes, ti.cast(0.0, float), i, before)

    @ti.func
    def moving(self, state: Template, slopes: Template, h, i, own):
        """The part with velocities, those of all other bodies changed by h times the velocities of `slopes`."""
        result = ti.Vector.zero(float, state.dimensions)
        begin = i // state.particle_count * state.particle_count + self.group[0]
        if i >= begin and i < begin + self.group[1]:
            for j in range(begin, begin + self.group[1]):
                if j != i:
                    d, other = separation(state, i, j), velocity_seen(state, j) + h * velocity_seen(slopes, j)
                    inverse = inverse_root(d.dot(d))
                    pull = parameter(state, self.strength) * state.mass[j] * inverse * inverse * inverse
                    near = inverse * d.dot(other)
                    size = own.dot(own) + 2.0 * other.dot(other) - 4.0 * own.dot(other) - 1.5 * near * near
                    result += pull * (size * d + d.dot(4.0 * own - 3.0 * other) * (other - own))
        return result / (parameter(state, self.speed_of_light) * parameter(state, self.speed_of_light))

    @ti.func
    def potential(self, state: Template, i, time):
        """Share of body i in the energy of the order c⁻², with that of its velocity."""
        result = ti.cast(0.0, state.wide)
        begin = i // state.particle_count * state.particle_count + self.group[0]
        if i >= begin and i < begin + self.group[1]:
            own, strength = wide_velocity(state, i), wide_number(state, parameter(state, self.strength))
            pulled = ti.cast(0.0, state.wide)
            for j in range(begin, begin + self.group[1]):
                if j != i:
                    d, other = wide_position(state, j) - wide_position(state, i), wide_velocity(state, j)
                    inverse = inverse_root(d.dot(d))
                    part = strength * wide_number(state, state.mass[j]) * inverse
                    pulled += part
                    along = inverse * inverse * d.dot(own) * d.dot(other)
                    result += part * (1.5 * own.dot(own) - 1.75 * own.dot(other) - 0.25 * along)
            result += 0.375 * own.dot(own) * own.dot(own) + 0.5 * pulled * pulled
            light = wide_number(state, parameter(state, self.speed_of_light))
            result *= wide_number(state, state.mass[i]) / (light * light)
        return result
