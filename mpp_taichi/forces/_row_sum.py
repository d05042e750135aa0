"""Row sum: the force on one particle from the half-springs of its row, for numbers of any kind."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import has_plain_numbers, zero_vector
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.state.half_springs import own_entry
from mpp_taichi.types import Template

# Half-springs of a particle in a vector: an SSE register in f32, two in f64; twice as many are no faster.
ROW_LANE_BITS = 2
ROW_LANES = 1 << ROW_LANE_BITS


@ti.func
def half_spring(state: Template, i, j, h, bond: Template, friction: Template):
    """Force of half-spring h on particle i, or only its friction."""
    result = zero_vector(state)
    if ti.static(friction):
        result += bond.friction(state, i, j, h)
    else:
        result += bond.force(state, i, j, h)
    return result


@traced
def row_sum(state, first, i, bond, friction):
    """Force on particle i from its half-springs."""
    row = row_sum_in_lanes if has_plain_numbers(state) else row_sum_in_turn
    return row(state, first, i, bond, friction)


@ti.func
def row_sum_in_lanes(state: Template, first, i, bond: Template, friction: Template):
    """Force on particle i from its half-springs: four at a time, with a sum for each lane, then the remaining half-springs.

    LLVM makes vector instructions of the four lanes, above all of square roots and divisions. The order of the sum depends
    only on the row.
    """
    begin = state.spring_start[i - first]
    end = state.spring_start[i - first + 1]
    blocks = (end - begin) >> ROW_LANE_BITS
    lanes = [ti.Vector.zero(float, ROW_LANES) for axis in ti.static(range(state.dimensions))]
    for block in range(blocks):
        h = begin + block * ROW_LANES
        forces = [
            half_spring(state, i, first + state.spring_neighbor[h + lane], own_entry(state, first, h + lane), bond, friction)
            for lane in ti.static(range(ROW_LANES))
        ]
        for axis in ti.static(range(state.dimensions)):
            lanes[axis] += ti.Vector([forces[lane][axis] for lane in ti.static(range(ROW_LANES))])
    total = ti.Vector([lanes[axis].sum() for axis in ti.static(range(state.dimensions))])
    for h in range(begin + blocks * ROW_LANES, end):
        total += half_spring(state, i, first + state.spring_neighbor[h], own_entry(state, first, h), bond, friction)
    return total


@ti.func
def row_sum_in_turn(state: Template, first, i, bond: Template, friction: Template):
    """`row_sum` of numbers of any kind, one half-spring after the other."""
    total = zero_vector(state)
    for h in range(state.spring_start[i - first], state.spring_start[i - first + 1]):
        total += half_spring(state, i, first + state.spring_neighbor[h], own_entry(state, first, h), bond, friction)
    return total
