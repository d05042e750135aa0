"""The velocity with which a sphere leaves a wall: a mirror, or a wall that has a temperature."""

import taichi as ti
from taichi.math import uvec2, uvec4

from mpp_taichi.arithmetic.random_numbers import bits_of, normal_numbers, random_words
from mpp_taichi.contacts.shared.impulse import pushed
from mpp_taichi.contacts.shared.wall_friction import rubbed
from mpp_taichi.types import Template


@ti.func
def off_wall(walls: Template, surface, i, n, v, wall_velocity, w, bounce, time):
    """The velocity of sphere i after it has met a surface, the impulse on it along n, and the energy that the wall takes.

    `bounce` is the result of `impulse_between` for this contact, which counts where the surface has no temperature; the other
    arguments are those of `thermal_velocity`. The energy of a surface without a temperature is that in its own frame.
    """
    after, impulse, lost = pushed(v, w, n, bounce[0], bounce[1], 1), bounce[0], bounce[2]
    if ti.static(walls.rubs):
        after, taken = rubbed(walls, surface, n, after, wall_velocity, w, impulse)
        lost += taken
    if ti.static(walls.heats):
        heat, seed = walls.temperature(surface)
        if heat >= 0.0:
            after, impulse, lost = thermal_velocity(i, n, v, wall_velocity, w, heat, seed, surface, time)
    return after, impulse, lost


@ti.func
def thermal_velocity(i, n, v, wall_velocity, w, heat, seed, surface, time):
    """The new velocity of sphere i, the impulse on it along n [momentum], and the kinetic energy that the wall takes [energy].

    n, wall_velocity  normal of the wall, into the free side, and its velocity
    v, w              velocity of the sphere before, and its inverse masses along the axes, 0 along a held axis
    heat, seed        k T of the wall, and the number that chooses the velocities
    surface, time     number of the surface, and time of the contact

    The sphere leaves as if it had come through an opening from a gas of the temperature T at rest in the frame of the wall:
    along n with the density (m v/kT) exp(−m v²/(2kT)), v > 0, which the length of a vector of two normal numbers has, and along
    the wall with normal numbers of the variance kT/m. In equilibrium with such a wall a gas has Maxwell's distribution.
    The numbers are a function of the sphere, of its velocity, of the time and of the seed, so that the bits are the same
    however a drift is cut.
    Source: Tehver, Toigo, Koplik & Banavar, Phys. Rev. E 57 (1998) R17.
    """
    counter = uvec4(ti.cast(i, ti.u32), bits_of(v[0]), bits_of(v[1]), bits_of(time))
    first = normal_numbers(random_words(counter, uvec2(seed, 2 * ti.cast(surface, ti.u32))))
    second = normal_numbers(random_words(counter, uvec2(seed, 2 * ti.cast(surface, ti.u32) + ti.u32(1))))
    lightest = w.max()
    spread = ti.sqrt(ti.cast(heat, float) * lightest)
    along = ti.Vector.zero(float, n.n)
    for k in ti.static(range(n.n)):
        along[k] = ti.cast(second[k], float)
    normal_speed = ti.cast(ti.sqrt(first[0] * first[0] + first[1] * first[1]), float)
    after = wall_velocity + spread * (along + (normal_speed - along.dot(n)) * n)
    impulse, lost = ti.cast(0.0, float), ti.cast(0.0, float)
    for k in ti.static(range(n.n)):
        if w[k] == 0.0:
            after[k] = v[k]
        else:
            impulse += (after[k] - v[k]) * n[k] / w[k]
            lost += 0.5 * (v[k] - after[k]) * (v[k] + after[k]) / w[k]
    return after, impulse, lost
