"""Constants, roots, choices and vectors for the formulas of forces, whatever the kind of the numbers is.

Values are plain numbers of the run's precision, except in three cases: double-single numbers (double_single.py) where the
forces of a state have low parts (precision df64), dual numbers (dual.py) in the tangent of a step, and lanes (lanes.py) where
several copies of a system move together. The last two are the `number_kind` of a state. The functions are Python functions
that run while a kernel is compiled.
"""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic import double_single
from mpp_taichi.arithmetic.double_single import DoubleSingle
from mpp_taichi.arithmetic.kernel_number import KernelNumber, NumberVector
from mpp_taichi.arithmetic.traced import entry_of, traced


def in_two_parts(state: Any) -> bool:
    """Whether the forces of a state have low parts."""
    return bool(state.forces_see_low and state.forces_have_low)


def has_plain_numbers(state: Any) -> bool:
    """Whether the numbers of the forces are the plain numbers of Taichi."""
    return state.number_kind is None and not in_two_parts(state)


@traced
def parameter(state: Any, value: Any) -> Any:
    """A parameter of a force, fixed or live, as a number to compute with."""
    if state.number_kind is not None:
        return state.number_kind(value if isinstance(value, KernelNumber) else ti.cast(value, float))
    if not in_two_parts(state):
        return ti.cast(value, float)
    if isinstance(value, DoubleSingle):
        return DoubleSingle(state, value.high, value.low)
    return double_single.constant(state, value)


@traced
def parameter_vector(state: Any, values: Any) -> Any:
    """The first components of a parameter of three components, as many as the state has dimensions."""
    return vector_of(state, [parameter(state, values[k]) for k in range(state.dimensions)])


@traced
def vector_of(state: Any, numbers: Sequence[Any]) -> Any:
    """A vector of numbers of the kind of the state's forces."""
    return ti.lang.matrix.make_matrix(list(numbers), float) if has_plain_numbers(state) else NumberVector(numbers)


@traced
def components(vector: Any, count: int) -> list[Any]:
    """The first components of a vector, whatever the kind of its numbers is."""
    return [vector[k] if isinstance(vector, NumberVector) else entry_of(vector, k) for k in range(count)]


@traced
def zero_vector(state: Any) -> Any:
    """A vector of zeros, to be added to."""
    if state.number_kind is not None:
        return NumberVector(state.number_kind.zero() for _ in range(state.dimensions))
    return double_single.zeros(state) if in_two_parts(state) else ti.Vector.zero(float, state.dimensions)


@traced
def copied(vector: Any) -> Any:
    """A vector that may be assigned to without a change of the entry of a field from which it was read."""
    return vector.copied() if isinstance(vector, NumberVector) else vector


@traced
def root(number: Any) -> Any:
    """√number."""
    return number.root() if isinstance(number, KernelNumber) else ti.sqrt(number)


@traced
def is_above_zero(number: Any) -> Any:
    """A condition for `where`: the number is above 0."""
    return number > 0.0


@traced
def is_not_zero(number: Any) -> Any:
    """A condition for `where`: the number is not 0."""
    return number != 0.0


@traced
def where(condition: Any, number: Any, other: Any) -> Any:
    """The number where a condition holds, else another number; neither needs to be finite where it is not taken.

    A condition comes from `is_above_zero` or `is_not_zero`: a comparison in a kernel would be one number for all lanes.
    """
    return number.where(condition, other) if isinstance(number, KernelNumber) else ti.select(condition, number, other)


@traced
def along_free_axes(state: Any, i: Any, vector: Any) -> Any:
    """The components of a vector along the axes that are free to particle i, and 0 along the others."""
    free = ti.lang.impl.subscript(None, state.free, i)
    if not isinstance(vector, NumberVector):
        return ti.select(free != 0.0, vector, 0.0)
    axes = range(vector.n)
    return NumberVector(vector[k].where(ti.lang.impl.subscript(None, free, k) != 0.0, 0.0) for k in axes)


@traced
def wide_number(state: Any, number: Any) -> Any:
    """Both parts of a number of the forces as one number of `state.wide`, the widest float of the device."""
    if not isinstance(number, DoubleSingle):
        return ti.cast(number, state.wide)
    return ti.cast(number.high, state.wide) + ti.cast(number.low, state.wide)
