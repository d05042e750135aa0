"""The tides that bodies raise on each other, and their push on both."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter
from mpp_taichi.arithmetic.inverse_distance import inverse_root
from mpp_taichi.arithmetic.particle_update import separation, velocity_seen
from mpp_taichi.component import AxialVector, Particles, component, param
from mpp_taichi.forces._base import ExternalForce, is_in
from mpp_taichi.forces._tides_at_rest import TidesAtRest
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template


@component
class MutualTides(ExternalForce):
    """Tide that a body raises on another, F = −3 k G m² R⁵/r⁸ (r + τ (2 r (r·v)/r² + r × Ω + v)) on the one, −F on the other.

    r and v are the place and the velocity of the body of mass m, of `by`, as seen from the body of `of`, which has the radius R
    and yields: its bulge follows with the delay τ. Both may move. For two bodies that yield the scene has two such forces, with
    a `name` each. The sum of the forces is 0, and the orbit gives its angular momentum to the spin Ω, which is kept as it is.
    On orbits of small eccentricity e about a body of mass M, with the angular frequency n,

    ȧ/a = 6 k τ G m (1 + m/M) R⁵ (Ω − n)/(n a⁸),  ė/e = −27 k τ G m (1 + m/M) R⁵ (1 − (11/18) Ω/n)/a⁸.

    A bulge that follows at once has the potential −½ k G m² R⁵/r⁶, and the energy balance counts the power of the delay, which
    becomes heat and turns the spin. A third body does not feel the bulge.
    Source: P. Hut, Astron. Astrophys. 99 (1981) 126; F. Mignard, Moon and Planets 20 (1979) 301.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    radius: float = param(above=0.0, unit="length", help="R, the radius of the body that yields")
    love_number: float = param(minimum=0.0, slider=True, help="k, by which it yields; 0.3 for the earth")
    lag: float = param(minimum=0.0, slider=True, unit="time", help="τ, the delay of the bulge")
    spin: AxialVector = param(unit="time⁻¹", help="Ω, of the body that yields, along its axis")
    of: Particles = param(help="the body, or the group of such bodies, that yields")
    by: Particles = param(None, optional=True, help="the body or group that raises the tide; absent: every other particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    needs = frozenset({"mass"})
    conserves_energy = False
    depends_on_velocity = True
    may_give_energy = True
    singular_at_zero_distance = True
    raises = (0, 0)

    def see(self, start: Snapshot) -> None:
        """Take the particles that raise the tide."""
        self.raises = self.by or (0, start.particle_count)

    def parts(self) -> tuple[ExternalForce, ...]:
        """The bulge that follows at once, which has a potential, and the part of the delay."""
        return TidesAtRest(self), self

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """The part of the delay, where particle i has this velocity."""
        result = ti.Vector.zero(float, state.dimensions)
        first = i // state.particle_count * state.particle_count
        for j in range(first, first + state.particle_count):
            weight = self.weight(state, i, j)
            if weight > 0.0:
                d, w = separation(state, i, j), velocity_seen(state, j) - velocity
                result += self.pull(state, d, weight) * (self.follow(d, w) + self.turned(state, d))
        return parameter(state, self.lag) / state.mass[i] * result

    @ti.func
    def acceleration_gained(self, state: Template, slopes: Template, h, i, time):
        """Change of the acceleration where the velocities of all bodies change; the force is linear in them."""
        result = ti.Vector.zero(float, state.dimensions)
        first = i // state.particle_count * state.particle_count
        for j in range(first, first + state.particle_count):
            weight = self.weight(state, i, j)
            if weight > 0.0:
                d, w = separation(state, i, j), velocity_seen(slopes, j) - velocity_seen(slopes, i)
                result += self.pull(state, d, weight) * self.follow(d, w)
        return h * parameter(state, self.lag) / state.mass[i] * result

    @ti.func
    def weight(self, state: Template, i, j):
        """The square of the mass that raises the tide between i and j, or the sum of both squares, or 0."""
        result = ti.cast(0.0, float)
        if i != j:
            if is_in(state, i, self.of) and is_in(state, j, self.raises):
                result += state.mass[j] * state.mass[j]
            if is_in(state, j, self.of) and is_in(state, i, self.raises):
                result += state.mass[i] * state.mass[i]
        return result

    @ti.func
    def pull(self, state: Template, d, weight):
        """3 k G R⁵/r⁸ times the weight."""
        inverse = inverse_root(d.dot(d))
        ratio = parameter(state, self.radius) * inverse
        fifth = ratio * ratio * ratio * ratio * ratio
        size = 3.0 * parameter(state, self.strength) * parameter(state, self.love_number) * weight
        return size * fifth * inverse * inverse * inverse

    @ti.func
    def follow(self, d, w):
        """2 d (d·w)/r² + w."""
        return w + (2.0 * d.dot(w) / d.dot(d)) * d

    @ti.func
    def turned(self, state: Template, d):
        """d × Ω, in two dimensions about z."""
        result = ti.Vector.zero(float, state.dimensions)
        if ti.static(state.dimensions == 3):
            result = d.cross(ti.Vector([parameter(state, self.spin[k]) for k in range(3)], float))
        else:
            result[0] = d[1] * parameter(state, self.spin[2])
            result[1] = -d[0] * parameter(state, self.spin[2])
        return result

    @ti.func
    def potential(self, state: Template, i, time):
        """0: the power of the delay is booked as dissipated."""
        return ti.cast(0.0, state.wide)
