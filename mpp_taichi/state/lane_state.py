"""Lane state: the fields of many copies of a system as lanes, so that one text of a step moves several copies at once.

A block is as many copies as a vector has lanes. Before a launch the numbers of a block are gathered, the entry of each copy
beside the entries of the others, and after it they are scattered again. The last block is filled up with its last copy.
"""

import copy
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.kernel_number import NumberVector
from mpp_taichi.arithmetic.lanes import LANES, Lanes, vector
from mpp_taichi.arithmetic.traced import entry_of
from mpp_taichi.state.field_group import FieldGroup

PREFIX = "tangent_"  # of the fields of changes, see tangent_state.py
MOVED = ("position", "velocity", "acceleration")
CONSTANT = ("mass", "charge")
"""Numbers that each copy has of its own, and a step does not change."""


class LaneField:
    """In a kernel `field[i]` are the lanes of particle i of a block, or a vector of them, which may be assigned to."""

    _data_oriented = True  # Taichi passes such objects on as they are

    def __init__(self, field: Any, components: int) -> None:
        """`field` is a vector field of lanes with an entry for each component of each particle; `components` 0: a scalar."""
        self.lanes = [field.get_scalar_field(lane) for lane in range(field.n)]
        self.n = components

    def __getitem__(self, i: Any) -> Any:
        """Entry i in a kernel."""
        return self._number(i) if self.n == 0 else NumberVector(self._number(i * self.n + k) for k in range(self.n))

    def _number(self, at: Any) -> Lanes:
        at = ti.lang.impl.expr_init(at)
        entries = [entry_of(lane, at) for lane in self.lanes]
        return Lanes(vector(entries), entries)


class SharedField:
    """In a kernel `field[i]` is a number, or a vector of numbers, that all copies share."""

    _data_oriented = True

    def __init__(self, field: Any) -> None:
        """Name the field of plain numbers, whose first copy is read."""
        self.field = field

    @property
    def n(self) -> int:
        """Number of components of a vector."""
        return int(self.field.n)

    def __getitem__(self, i: Any) -> Any:
        """Entry i in a kernel."""
        if not isinstance(self.field, ti.MatrixField):
            return Lanes(entry_of(self.field, i))
        return NumberVector(Lanes(entry_of(self.field.get_scalar_field(k), i)) for k in range(self.field.n))


@ti.data_oriented
class LaneState:
    """A state for kernels whose fields of real numbers give lanes."""

    number_kind = Lanes

    def __init__(self, state: Any) -> None:
        """Allocate the lanes of the fields of a state."""
        self._state, self.lane_count = state, LANES
        self.block_count = -(-state.replica_count // self.lane_count)
        entries = self.block_count * state.particle_count
        self._constant = tuple(name for name in CONSTANT if name in state.quantities)
        changes = [PREFIX] if PREFIX + MOVED[0] in state.quantities else []
        self._moved = tuple(prefix + name for prefix in ("", *changes) for name in MOVED)
        scratch = [f"scratch_{k}" for k in range(len(state.scratch))]
        names = (*self._moved, *(prefix + name for prefix in ("", *changes) for name in scratch))
        made = {name: ti.Vector.field(self.lane_count, float) for name in (*names, *self._constant)}
        self._memory = FieldGroup(
            *((entries * (1 if name in self._constant else state.dimensions), field) for name, field in made.items())
        )
        self._fields = {
            name: LaneField(field, 0 if name in self._constant else state.dimensions) for name, field in made.items()
        }
        self.scratch = tuple(self._fields[f"scratch_{k}"] for k in range(len(state.scratch)))
        self.moving_as_scratch = tuple(moving_as(self, each) for each in self.scratch)

    def __getattr__(self, name: str) -> Any:
        """A field as lanes; all else as the state has it."""
        if "_fields" not in vars(self):  # a copy that is being made
            raise AttributeError(name)
        if name in self._fields:
            return self._fields[name]
        found = getattr(self._state, name)
        return SharedField(found) if isinstance(found, (ti.ScalarField, ti.MatrixField)) and _is_real(found) else found

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    @ti.func
    def gather(self, block):
        """Copy the numbers of a block into the lanes."""
        for lane in ti.static(range(self.lane_count)):
            copy = ti.min(block * self.lane_count + lane, self._state.replica_count - 1)
            for i in range(self._state.particle_count):
                source, target = copy * self._state.particle_count + i, block * self._state.particle_count + i
                for components, lanes in ti.static(self._vectors(lane)):
                    for k in ti.static(range(self._state.dimensions)):
                        lanes[target * self._state.dimensions + k] = components[k][source]
                for plain, lanes in ti.static(self._scalars(lane)):
                    lanes[target] = plain[source]

    @ti.func
    def scatter(self, block):
        """Copy the lanes of a block back."""
        for lane in ti.static(range(self.lane_count)):
            copy = block * self.lane_count + lane
            if copy < self._state.replica_count:
                for i in range(self._state.particle_count):
                    source, target = block * self._state.particle_count + i, copy * self._state.particle_count + i
                    for components, lanes in ti.static(self._vectors(lane)):
                        for k in ti.static(range(self._state.dimensions)):
                            components[k][target] = lanes[source * self._state.dimensions + k]

    def fields_of(self, name: str) -> list[Any]:
        """The fields of the lanes, whose entry (block particle_count + i) dimensions + k is component k of particle i."""
        return list(self._fields[name].lanes)

    def _vectors(self, lane: int) -> list[tuple[list[Any], Any]]:
        """The components of each vector of the state, and the field of one lane.

        Explicit vectors reach a component of a vector that is stored as a whole by its scalar field only.
        """
        fields = [(getattr(self._state, name), self._fields[name].lanes[lane]) for name in self._moved]
        return [([plain.get_scalar_field(k) for k in range(plain.n)], lanes) for plain, lanes in fields]

    def _scalars(self, lane: int) -> list[tuple[Any, Any]]:
        """The fields of numbers that each copy has of its own, and the fields of one lane."""
        return [(getattr(self._state, name), self._fields[name].lanes[lane]) for name in self._constant]


def moving_as(state: Any, velocity: Any) -> Any:
    """The same fields with another field as velocity: the state that forces see on the way through a step."""
    result = copy.copy(state)
    result.velocity = velocity
    return result


def _is_real(field: Any) -> bool:
    return field.dtype in (ti.f32, ti.f64)
