"""Drift, kick and push of a particle, x += h v, v += h a and x += c a; and the differences of two particles that forces see.

The precisions f32c and ds carry low parts beside positions and velocities (low_parts.py). Each function here updates or reads
both where the state has them, so that an integrator is one text for all precisions.
"""

import taichi as ti

from mpp_taichi.arithmetic.low_parts import scaled_and_added
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
            high, low = state.position[i][k], state.position_low[i][k] + parts[0] * state.velocity_low[i][k]
            state.position[i][k], state.position_low[i][k] = scaled_and_added(state, high, low, parts, state.velocity[i][k])
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
            state.position[i][k], state.position_low[i][k] = scaled_and_added(state, high, low, parts, acceleration[k])
    else:
        for k in ti.static(range(state.dimensions)):
            state.position[i][k] = state.position[i][k] + number * acceleration[k]


@ti.func
def separation(state: Template, i, j):
    """x_j − x_i as forces see it. Where they see low parts, it is accurate however far from the origin both particles are."""
    result = state.position[j] - state.position[i]
    if ti.static(state.forces_see_low):
        result += state.position_low[j] - state.position_low[i]
    return result


@ti.func
def approach(state: Template, i, j):
    """v_j − v_i as forces see it, with the low parts of both velocities where forces see low parts."""
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
