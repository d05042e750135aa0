"""Field trees: memory for the fields of a solver, in trees whose numbers are of one width."""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import on_cpu


class FieldTrees:
    """Places fields, and gives their memory back; on Vulkan 8-byte numbers are not aligned in a tree with 4-byte ones."""

    def __init__(self) -> None:
        """Nothing is placed yet."""
        self._together = on_cpu()
        self._builders: dict[str, ti.FieldsBuilder] = {}
        self._trees: list[Any] = []

    def place(self, count: int, *numbers: Any, integers: Sequence[Any] = ()) -> None:
        """Fields with `count` entries, of floats and of i32; on the CPU entries of one index lie side by side."""
        if self._together:
            self._builder("all").dense(ti.i, count).place(*numbers, *integers)
        else:
            for name, fields in (("numbers", numbers), ("integers", integers)):
                for field in fields:
                    self._builder(name).dense(ti.i, count).place(field)

    def _builder(self, tree: str) -> ti.FieldsBuilder:
        if tree not in self._builders:
            self._builders[tree] = ti.FieldsBuilder()
        return self._builders[tree]

    def finish(self) -> None:
        """All fields are placed."""
        self._trees = [builder.finalize() for builder in self._builders.values()]

    def destroy(self) -> None:
        """Give the memory back."""
        for tree in self._trees:
            tree.destroy()
