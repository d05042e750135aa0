"""Tangent state: the fields of a state as dual numbers, so that the text of a step computes its own derivative."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.dual import Dual, DualLanes
from mpp_taichi.arithmetic.kernel_number import NumberVector
from mpp_taichi.arithmetic.traced import entry_of
from mpp_taichi.state.lane_state import MOVED, PREFIX, LaneField, SharedField, moving_as


def tangent_fields(particle_count: int, scratch_count: int) -> dict[str, tuple[str, int]]:
    """The work fields of a tangent, by name: kind and count for each replica (see State)."""
    names = (*MOVED, *(f"scratch_{k}" for k in range(scratch_count)))
    return {PREFIX + name: ("vector", particle_count) for name in names}


class DualField:
    """In a kernel `field[i]` is a dual number, or a vector of them; entries with a change may be assigned to."""

    _data_oriented = True  # Taichi passes such objects on as they are

    def __init__(self, value: Any, change: Any, kind: type[Dual] | type[DualLanes]) -> None:
        """Name the field of the numbers and the field of their changes, None for numbers that never change, and their kind."""
        self.value, self.change, self.kind = value, change, kind

    @property
    def n(self) -> int:
        """Number of components of a vector."""
        return int(self.value.n)

    def __getitem__(self, i: Any) -> Any:
        """Entry i in a kernel."""
        value, change = entry_of(self.value, i), None if self.change is None else entry_of(self.change, i)
        if not isinstance(self.value, ti.MatrixField) and not isinstance(value, NumberVector):
            return self.kind(value, change)
        return NumberVector(
            self.kind(entry_of(value, k), None if change is None else entry_of(change, k)) for k in range(self.n)
        )


class TangentState:
    """A state for kernels whose fields of real numbers give dual numbers, with their changes in the fields `tangent_…`.

    Of a LaneState they give dual numbers of several copies.
    """

    def __init__(self, state: Any) -> None:
        """`state` has the fields of `tangent_fields`."""
        self._state = state
        self.number_kind: type[Dual] | type[DualLanes] = Dual if state.number_kind is None else DualLanes
        self.scratch = tuple(getattr(self, f"scratch_{k}") for k in range(len(state.scratch)))
        self.moving_as_scratch = tuple(moving_as(self, each) for each in self.scratch)

    def __getattr__(self, name: str) -> Any:
        """A field as dual numbers; all else as the state has it."""
        if "_state" not in vars(self):  # a copy that is being made
            raise AttributeError(name)
        found = getattr(self._state, name)
        is_plain = isinstance(found, (ti.ScalarField, ti.MatrixField)) and found.dtype in (ti.f32, ti.f64)
        if is_plain or isinstance(found, (LaneField, SharedField)):
            return DualField(found, getattr(self._state, PREFIX + name, None), self.number_kind)
        return found
