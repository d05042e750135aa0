"""Drift, kick and push of a particle, x += h v, v += h a and x += c a; and the differences of two particles that forces see.

The precisions f32c, ds and df64 carry low parts beside positions and velocities (low_parts.py). Each function here updates or
reads both where the state has them, so that an integrator is one text for all precisions. In df64 accelerations and separations
are double-single numbers (double_single.py).
"""

import taichi as ti

from mpp_taichi.arithmetic.double_single import DoubleSingle
from mpp_taichi.arithmetic.force_numbers import in_two_parts
from mpp_taichi.arithmetic.kernel_number import NumberVector
from mpp_taichi.arithmetic.low_parts import scaled_and_added, scaled_and_added_with_rest
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.types import Template


@ti.func
def drifted(position, velocity, time):
    """x + h v, of a whole vector or of one component; the drift where there are no low parts."""
    return position + time * velocity


@ti.func
def kicked(velocity, acceleration, time):
    """v + h a, of a whole vector or of one component; the kick where there are no low parts."""
    return velocity + time * acceleration


@ti.func
def drift_particle(state: Template, i, time, entry):
    """Drift: x += h v, h the `time`. Where there are low parts, h is the number of `entry` in state.step_parts instead."""
    if ti.static(state.carries_low):
        parts = state.step_parts[entry]
        for k in ti.static(range(state.dimensions)):
            velocity, velocity_low = state.velocity[i][k], state.velocity_low[i][k]
            if ti.static(state.carries_rest):
                three = state.position[i][k], state.position_low[i][k], state.position_rest[i][k]
                state.position[i][k], state.position_low[i][k], state.position_rest[i][k] = scaled_and_added_with_rest(
                    state, three, parts, velocity, parts[0] * velocity_low
                )
            else:
                high, low = state.position[i][k], state.position_low[i][k] + parts[0] * velocity_low
                state.position[i][k], state.position_low[i][k] = scaled_and_added(state, high, low, parts, velocity)
    else:
        for k in ti.static(range(state.dimensions)):
            state.position[i][k] = drifted(state.position[i][k], state.velocity[i][k], time)


@ti.func
def kick_particle(state: Template, i, time, entry, acceleration: Template):
    """Kick: v += h a, h the `time`. Where there are low parts, h is the number of `entry` in state.step_parts instead."""
    if ti.static(state.carries_low):
        parts = state.step_parts[entry]
        for k in ti.static(range(state.dimensions)):
            high, low = state.velocity[i][k], state.velocity_low[i][k]
            if ti.static(state.carries_rest):
                three, addend = (high, low, state.velocity_rest[i][k]), parts[0] * acceleration[k].low
                state.velocity[i][k], state.velocity_low[i][k], state.velocity_rest[i][k] = scaled_and_added_with_rest(
                    state, three, parts, acceleration[k].high, addend
                )
            else:
                state.velocity[i][k], state.velocity_low[i][k] = scaled_and_added(state, high, low, parts, acceleration[k])
    else:
        for k in ti.static(range(state.dimensions)):
            state.velocity[i][k] = kicked(state.velocity[i][k], acceleration[k], time)


@ti.func
def push_particle(state: Template, i, number, entry, acceleration: Template):
    """Push: x += c a, c the `number`. Where there are low parts, c is the number of `entry` in state.step_parts instead."""
    if ti.static(state.carries_low):
        parts = state.step_parts[entry]
        for k in ti.static(range(state.dimensions)):
            high, low = state.position[i][k], state.position_low[i][k]
            if ti.static(state.carries_rest):
                three, addend = (high, low, state.position_rest[i][k]), parts[0] * acceleration[k].low
                state.position[i][k], state.position_low[i][k], state.position_rest[i][k] = scaled_and_added_with_rest(
                    state, three, parts, acceleration[k].high, addend
                )
            else:
                state.position[i][k], state.position_low[i][k] = scaled_and_added(state, high, low, parts, acceleration[k])
    else:
        for k in ti.static(range(state.dimensions)):
            state.position[i][k] = state.position[i][k] + number * acceleration[k]


@traced
def high_part(number):
    """The high part of a double-single number; a number of one part itself."""
    return number.high if isinstance(number, DoubleSingle) else number


@traced
def step_number(state, number, entry):
    """A number of the step for a force to compute with: in df64 the number of `entry` in state.step_parts."""
    if not in_two_parts(state):
        return number
    parts = ti.lang.impl.subscript(None, state.step_parts, entry)
    return DoubleSingle(state, *(ti.lang.impl.subscript(None, parts, k) for k in range(2)))


@traced
def both_parts(state, high, low, i):
    """The vector i of two fields, one for the high and one for the low parts."""
    entries = [ti.lang.impl.subscript(None, field, i) for field in (high, low)]
    axes = range(state.dimensions)
    return NumberVector(DoubleSingle(state, *(ti.lang.impl.subscript(None, each, k) for each in entries)) for k in axes)


@traced
def position_seen(state, i):
    """x_i as forces on a single particle see it."""
    if in_two_parts(state):
        return both_parts(state, state.position, state.position_low, i)
    return ti.lang.impl.subscript(None, state.position, i)


@traced
def velocity_seen(state, i):
    """v_i as forces see it."""
    if in_two_parts(state) and state.velocity_has_low:
        return both_parts(state, state.velocity, state.velocity_low, i)
    return ti.lang.impl.subscript(None, state.velocity, i)


@traced
def separation(state, i, j):
    """x_j − x_i as forces see it. Where they see low parts, it is accurate however far from the origin both particles are."""
    if not in_two_parts(state):
        return _rounded_separation(state, i, j)
    ends = [both_parts(state, state.position, state.position_low, end) for end in (i, j)]
    return ends[1] - ends[0]


@traced
def approach(state, i, j):
    """v_j − v_i as forces see it, with the low parts of both velocities where forces see low parts."""
    return velocity_seen(state, j) - velocity_seen(state, i) if in_two_parts(state) else _rounded_approach(state, i, j)


@ti.func
def _rounded_separation(state: Template, i, j):
    result = state.position[j] - state.position[i]
    if ti.static(state.forces_see_low):
        result += state.position_low[j] - state.position_low[i]
    return result


@ti.func
def _rounded_approach(state: Template, i, j):
    result = state.velocity[j] - state.velocity[i]
    if ti.static(state.forces_see_low and state.velocity_has_low):
        result += state.velocity_low[j] - state.velocity_low[i]
    return result


@ti.func
def wide_position(state: Template, i):
    """x_i and its low part as one number of `state.wide`, the widest float of the device."""
    result = ti.cast(state.position[i], state.wide)
    if ti.static(state.carries_low):
        result += ti.cast(state.position_low[i], state.wide)
    return result


@ti.func
def wide_velocity(state: Template, i):
    """v_i and its low part as one number of `state.wide`, the widest float of the device."""
    result = ti.cast(state.velocity[i], state.wide)
    if ti.static(state.carries_low):
        result += ti.cast(state.velocity_low[i], state.wide)
    return result
