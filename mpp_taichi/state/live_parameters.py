"""Live parameters: numbers of a force that kernels load from a field, so that they may change while compiled kernels run.

A parameter that the scene fixes is a constant of its kernels, and costs nothing. A parameter that `sliders:` names must change
without a compilation. A force with such parameters is therefore an instance of a class made at run time, with a property for
each of them: in a kernel that is being compiled the property is a load from a field, elsewhere it is the number. The formula
in the file of the force is the same text for both. Replicas may have values of their own: then the field has a row for each,
and a kernel says by `at_replica` which row the loads after it take.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.double_single import DoubleSingle
from mpp_taichi.arithmetic.lanes import Lanes, vector
from mpp_taichi.arithmetic.low_parts import split
from mpp_taichi.device import bulk_copy
from mpp_taichi.scene.spec import ComponentSpec
from mpp_taichi.state.field_group import FieldGroup

COMPONENTS = 3  # entries of a parameter in the field, enough for a vector


class LiveParameters:
    """The live parameters of the forces of a scene, in one field; `forces` are the forces that load their parameters from it.

    Numbers have the precision of the run, like constants of kernels; with `two_parts` they are double-single numbers, which a
    force takes through `parameter` (arithmetic/force_numbers.py).
    """

    def __init__(
        self, entries: Sequence[ComponentSpec], forces: Sequence[Any], *, two_parts: bool = False, replica_count: int = 1
    ) -> None:
        """Allocate a row for each replica; the first forces were built from the `entries`, one for each."""
        self.replica_count = replica_count
        self._row: tuple[Any, Any] = (None, 0)  # the kernel that was last told its replica, and the number of the replica
        self._lanes = 1
        self._places: dict[tuple[str, str], int] = {}
        count = 0
        for entry in entries:
            for name in entry.live:
                self._places[entry.label, name] = count
                count += COMPONENTS
        self._values = np.zeros((replica_count, count))
        self.forces = tuple(forces)
        self._memory: Any = None
        if count == 0:
            return
        self._fields = [ti.field(float) for _ in range(2 if two_parts else 1)]  # the second has the low parts
        self._memory = FieldGroup((count * replica_count, *self._fields))
        made = [self._loading(entry, force) for entry, force in zip(entries, forces)]
        self.forces = (*made, *forces[len(entries) :])
        self.write(entries)

    def write(self, entries: Sequence[ComponentSpec]) -> None:
        """Set the values of these entries in all rows, which the forces use from the next launch on."""
        self.write_rows([entries] * self.replica_count)

    def write_rows(self, rows: Sequence[Sequence[ComponentSpec]]) -> None:
        """Set the values of each replica by entries of its own."""
        if self._memory is None:
            return
        for entry in rows[0]:
            for name in entry.live:
                place = self._places[entry.label, name]
                own = [next(each for each in row if each.label == entry.label).parameters[name] for row in rows]
                numbers = np.array([value if isinstance(value, tuple) else (value,) for value in own], np.float64)
                self._values[:, place : place + numbers.shape[1]] = numbers
        values = self._values.ravel()
        dtype = np.float32 if self._fields[0].dtype == ti.f32 else np.float64
        arrays = split(values) if len(self._fields) > 1 else (values.astype(dtype),)
        bulk_copy.write(self._fields, arrays)

    def at_replica(self, replica: Any, lanes: int = 1) -> None:
        """Let all loads of the kernel that is being compiled, from here on, take the row of this replica, or `lanes` rows."""
        self._row = (ti.lang.impl.get_runtime().compiling_callable, replica)
        self._lanes = lanes

    def destroy(self) -> None:
        """Free the memory."""
        if self._memory is not None:
            self._memory.destroy()

    def _loading(self, entry: ComponentSpec, force: Any) -> Any:
        """The force with a property in place of each live parameter."""
        if not entry.live:
            return force
        loads = {name: self._property(self._places[entry.label, name], entry.parameters[name]) for name in entry.live}
        return _with_properties(force, loads)

    def _property(self, place: int, example: Any) -> property:
        def load(_: Any) -> Any:
            if not ti.lang.impl.inside_kernel():
                numbers = tuple(self._values[0, place : place + COMPONENTS].tolist())
                return numbers if isinstance(example, tuple) else numbers[0]
            loaded = [self._loaded(place + k) for k in range(COMPONENTS)]
            return tuple(loaded) if isinstance(example, tuple) else loaded[0]

        return property(load)

    def _loaded(self, place: int) -> Any:
        at: Any = place
        if self.replica_count > 1:
            kernel, replica = self._row
            if kernel is not ti.lang.impl.get_runtime().compiling_callable:
                raise TypeError("a kernel over replicas reads a parameter without `at_replica`")
            if self._lanes > 1:
                return self._loaded_lanes(replica, place)
            at = replica * self._values.shape[1] + place
        parts = [ti.lang.impl.subscript(None, field, at) for field in self._fields]
        return DoubleSingle(None, *parts) if len(parts) > 1 else parts[0]

    def _loaded_lanes(self, replica: Any, place: int) -> Lanes:
        """The numbers of as many replicas as there are lanes; of the last replica where there are fewer."""
        rows = [ti.min(replica + lane, self.replica_count - 1) for lane in range(self._lanes)]
        return Lanes(vector(ti.lang.impl.subscript(None, self._fields[0], row * self._values.shape[1] + place) for row in rows))


def _with_properties(force: Any, properties: Mapping[str, property]) -> Any:
    """An object like `force` whose class has these properties in place of attributes."""
    kind = type(force)
    made: Any = object.__new__(type(kind.__name__, (kind,), {"__module__": kind.__module__, **properties}))
    vars(made).update({name: value for name, value in vars(force).items() if name not in properties})
    return made
