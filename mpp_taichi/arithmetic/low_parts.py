"""Low parts: what a number loses when it is rounded, carried beside it, so that a sum of many steps loses nothing.

A position is high + low, unevaluated, |low| ≤ half a unit in the last place of high: 48 bits from two f32. An update is

    y = c v + low,  high' = high + y,  low' = y − (high' − high)    [Kahan and Møller]

with c, a number of the step, and the product known to 36 bits: with a kick's product rounded to 24, the energy errors of
clusters in f32c and ds were two to five times as large. What is lost is the rounding of y: h ω smaller than that of high in a
motion of frequency ω, and less than what forces lose, which are f32 of separations that see the low parts (ds) or not (f32c).
|high| < |y|, where a coordinate passes zero, costs another rounding of y.

Compilers that are free to reorder turn (high + y) − high into y. LLVM, here, is not. Drivers that read SPIR-V are, as Taichi
does not mark operations NoContraction: there the sum goes through `rounded`, an exclusive or with a zero that only the running
kernel reads; a mere bit cast is seen through. A probe finds out which is needed, and that it is enough (probes.py).
Source: Møller, BIT 5 (1965) 37 and 251; Kahan, Comm. ACM 8 (1965) 40; Dekker, Numer. Math. 18 (1971) 224.
"""

import numpy as np
import taichi as ti

from mpp_taichi.types import Template

HEAD_BITS = 12  # of 24: a product of two heads is exact
HEAD_MASK = -(1 << 24 - HEAD_BITS)  # keeps them, of the 32 bits of an f32


def split(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Double numbers as high and low, together right to 2⁻⁴⁹."""
    high = values.astype(np.float32)
    with np.errstate(invalid="ignore"):  # ∞ − ∞
        return high, (values - high.astype(np.float64)).astype(np.float32)


def step_parts(numbers: list[float]) -> np.ndarray:
    """Head, of 12 significant bits, and rest of each number, (count, 2) in f32; together right to 2⁻³⁷."""
    fraction, exponent = np.frexp(np.array(numbers))
    head = np.ldexp(np.rint(np.ldexp(fraction, HEAD_BITS)), exponent - HEAD_BITS)
    return np.stack([head, np.array(numbers) - head], axis=1).astype(np.float32)


@ti.func
def rounded(state: Template, value):
    """A number that the compiler cannot see the making of, where it would make use of it."""
    result = value
    if ti.static(state.guards_rounding):
        result = ti.bit_cast(ti.bit_cast(value, ti.i32) ^ state.nothing[None], ti.f32)
    return result


@ti.func
def added(state: Template, high, low, addend):
    """(high + low) + addend, as high and low again."""
    corrected = addend + low
    total = rounded(state, high + corrected)
    return total, corrected - (total - high)


@ti.func
def head_of(value):
    """A number cut to its first 12 significant bits."""
    return ti.bit_cast(ti.bit_cast(value, ti.i32) & HEAD_MASK, ti.f32)


@ti.func
def scaled_and_added(state: Template, high, low, parts, factor):
    """(high + low) + number × factor, the number that of `parts`: its head of 12 bits and the rest."""
    head = head_of(factor)  # 12 bits as well, so that the product of the two is exact
    rest = parts[0] * (factor - head) + (parts[1] * factor + low)
    return added(state, high, rest, parts[0] * head)


@ti.func
def drift_particle(state: Template, i, time, entry):
    """x += time × v; with low parts, the time is that of `entry` in state.step_parts."""
    if ti.static(state.carries_low):
        parts = state.step_parts[entry]
        for k in ti.static(range(state.dimensions)):
            high, low = state.position[i][k], state.position_low[i][k] + parts[0] * state.velocity_low[i][k]
            state.position[i][k], state.position_low[i][k] = scaled_and_added(state, high, low, parts, state.velocity[i][k])
    else:
        for k in ti.static(range(state.dimensions)):
            state.position[i][k] = state.position[i][k] + time * state.velocity[i][k]


@ti.func
def kick_particle(state: Template, i, time, entry, acceleration: Template):
    """v += time × a; with low parts, the time is that of `entry` in state.step_parts."""
    if ti.static(state.carries_low):
        parts = state.step_parts[entry]
        for k in ti.static(range(state.dimensions)):
            high, low = state.velocity[i][k], state.velocity_low[i][k]
            state.velocity[i][k], state.velocity_low[i][k] = scaled_and_added(state, high, low, parts, acceleration[k])
    else:
        for k in ti.static(range(state.dimensions)):
            state.velocity[i][k] = state.velocity[i][k] + time * acceleration[k]


@ti.func
def push_particle(state: Template, i, number, entry, acceleration: Template):
    """x += number × a; with low parts, the number is that of `entry` in state.step_parts."""
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
