"""The impulse of a contact, and the velocities after it, which are rounded once.

A rounding error of the impulse would not average out: the length of a normal is 1 but for a rounding error, the floats below 1
lie closer than the floats above 1, and in a circle or between planes the same numbers come back at every bounce. Speeds would
drift to one side, by 10⁻¹⁷ of their size a bounce in double precision. With an impulse of twice as many digits the error of a
bounce is the rounding of the new velocity, which has no preferred sign.
"""

import taichi as ti

from mpp_taichi.arithmetic.error_free import two_product, two_sum
from mpp_taichi.types import Template


@ti.func
def impulse_between(n, velocity, other_velocity, w, other_w, e):
    """Impulse along n on a sphere, as J and its low part [momentum], and the kinetic energy that it takes [energy].

    n                 direction from the other sphere or surface to the sphere, of a length near 1
    velocity, …       of the sphere and of the other sphere or surface [length / time]
    w, other_w        inverse masses along the axes; 0 for a surface [1 / mass]
    e                 restitution

    J = −(1 + e) n·(v − v′) / Σ_k n_k² (w_k + w′_k), and the energy is (1 − e²) (n·(v − v′))² / (2 Σ …). The impulse is right
    for n of any length. The result is 0 where neither can move along n.
    """
    speed, yielding = ti.cast(0.0, float), ti.cast(0.0, float)
    speed_low, yielding_low = ti.cast(0.0, float), ti.cast(0.0, float)
    for k in ti.static(range(n.n)):
        u, u_low = two_sum(velocity[k], -other_velocity[k])
        part, part_low = two_product(n[k], u)
        speed, carry = two_sum(speed, part)
        speed_low += carry + (part_low + n[k] * u_low)
        weight, weight_low = two_sum(w[k], other_w[k])
        square, square_low = two_product(n[k], n[k])
        share, share_low = two_product(square, weight)
        yielding, rest = two_sum(yielding, share)
        yielding_low += rest + (share_low + (square_low * weight + square * weight_low))
    result = ti.Vector.zero(float, 3)
    if yielding > 0.0:
        gain, inertia = 1.0 + e, 1.0 / yielding
        wanted, wanted_low = two_product(gain, speed)
        impulse = -wanted * inertia
        given, given_low = two_product(impulse, yielding)
        missing = (wanted + given) + (wanted_low + given_low + (gain * speed_low + impulse * yielding_low))
        result[0] = impulse
        result[1] = -missing * inertia
        result[2] = 0.5 * (1.0 - e) * wanted * speed * inertia
    return result


@ti.func
def pushed(velocity, w, n, impulse, impulse_low, sign: Template):
    """The velocity v ± J w n of a sphere after an impulse J along n, whose two parts are given, rounded once.

    `sign` is 1 or −1. Two spheres of a contact share J n, which the compiler then computes once.
    """
    result = velocity
    for k in ti.static(range(n.n)):
        push, push_low = two_product(impulse, n[k])
        kick, kick_low = two_product(push, w[k])
        total, rest = two_sum(velocity[k], sign * kick)
        result[k] = total + (rest + sign * (kick_low + (push_low + impulse_low * n[k]) * w[k]))
    return result
