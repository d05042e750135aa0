"""Low parts: what a number loses when it is rounded, carried beside it, so that a sum of many steps loses nothing.

A position is high + low, unevaluated, |low| ≤ half a unit in the last place of high: 48 bits from two f32. An update is

    y = c v + low,  high' = high + y,  low' = y − (high' − high)    [Kahan and Møller]

with the c of a step known to 48 bits, too (`step_parts`). What is lost is the rounding of y, h ω smaller than that of high in a
motion of frequency ω, and of the same size as that of the forces, which are computed in f32 from separations that see the low
parts (ds) or do not (f32c). |high| < |y|, where a coordinate passes zero, costs as much once, no more.

Compilers that are free to reorder turn (high + y) − high into y. LLVM, here, is not. Drivers that read SPIR-V are, as Taichi
does not mark operations NoContraction: there the sum goes through `rounded`, an exclusive or with a zero that only the running
kernel reads; a mere bit cast is seen through. A probe finds out which is needed, and that it is enough (probes.py).
Source: Møller, BIT 5 (1965) 37 and 251; Kahan, Comm. ACM 8 (1965) 40; Dekker, Numer. Math. 18 (1971) 224.
"""

import numpy as np
import taichi as ti

from mpp_taichi.types import Template


def split(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Double numbers as high and low, together right to 2⁻⁴⁹."""
    high = values.astype(np.float32)
    with np.errstate(invalid="ignore"):  # ∞ − ∞
        return high, (values - high.astype(np.float64)).astype(np.float32)


def step_parts(numbers: list[float]) -> np.ndarray:
    """High and low part of each number, (count, 2) in f32."""
    return np.stack(split(np.array(numbers)), axis=1)


@ti.func
def rounded(state: Template, value):
    """A number that the compiler cannot see the making of, where it would make use of it."""
    result = value
    if ti.static(state.guards_rounding):
        result = ti.bit_cast(ti.bit_cast(value, ti.i32) ^ state.nothing[None], ti.f32)
    return result


@ti.func
def added(state: Template, high, low, parts, factor):
    """(high + low) + (parts[0] + parts[1]) factor, as high and low again."""
    addend = parts[0] * factor + (parts[1] * factor + low)
    total = rounded(state, high + addend)
    return total, addend - (total - high)


@ti.func
def drift_particle(state: Template, i, time, entry):
    """x += time × v; with low parts, the time is that of `entry` in state.step_parts."""
    if ti.static(state.carries_low):
        parts = state.step_parts[entry]
        for k in ti.static(range(state.dimensions)):
            carried = state.position_low[i][k] + parts[0] * state.velocity_low[i][k]
            high, low = added(state, state.position[i][k], carried, parts, state.velocity[i][k])
            state.position[i][k] = high
            state.position_low[i][k] = low
    else:
        state.position[i] = state.position[i] + time * state.velocity[i]


@ti.func
def kick_particle(state: Template, i, time, entry, acceleration):
    """v += time × a; with low parts, the time is that of `entry` in state.step_parts."""
    if ti.static(state.carries_low):
        parts = state.step_parts[entry]
        for k in ti.static(range(state.dimensions)):
            high, low = added(state, state.velocity[i][k], state.velocity_low[i][k], parts, acceleration[k])
            state.velocity[i][k] = high
            state.velocity_low[i][k] = low
    else:
        state.velocity[i] = state.velocity[i] + time * acceleration


@ti.func
def push_particle(state: Template, i, entry, acceleration):
    """x += number × a, that of `entry` in state.step_parts, where there are low parts."""
    parts = state.step_parts[entry]
    for k in ti.static(range(state.dimensions)):
        high, low = added(state, state.position[i][k], state.position_low[i][k], parts, acceleration[k])
        state.position[i][k] = high
        state.position_low[i][k] = low


@ti.func
def separation(state: Template, i, j):
    """x_j − x_i as forces see it: where they see low parts, right however far from the origin the two are."""
    result = state.position[j] - state.position[i]
    if ti.static(state.forces_see_low):
        result += state.position_low[j] - state.position_low[i]
    return result


@ti.func
def approach(state: Template, i, j):
    """v_j − v_i as forces see it."""
    result = state.velocity[j] - state.velocity[i]
    if ti.static(state.forces_see_low and state.velocity_has_low):
        result += state.velocity_low[j] - state.velocity_low[i]
    return result


@ti.func
def wide_position(state: Template, i):
    """x_i with its low part, in `state.wide`."""
    result = ti.cast(state.position[i], state.wide)
    if ti.static(state.carries_low):
        result += ti.cast(state.position_low[i], state.wide)
    return result


@ti.func
def wide_velocity(state: Template, i):
    """v_i with its low part, in `state.wide`."""
    result = ti.cast(state.velocity[i], state.wide)
    if ti.static(state.carries_low):
        result += ti.cast(state.velocity_low[i], state.wide)
    return result
