"""Field trees: memory for the fields of a solver, in trees whose entries have one width."""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import on_cpu


class FieldTrees:
    """Places fields, and gives their memory back.

    On Vulkan an 8-byte number is not aligned in a tree that also holds 4-byte numbers, so floats and integers have trees of
    their own there.
    """

    def __init__(self) -> None:
        """Begin without any field."""
        self._together = on_cpu()
        self._builders: dict[str, ti.FieldsBuilder] = {}
        self._trees: list[Any] = []

    def place(self, count: int, *numbers: Any, integers: Sequence[Any] = ()) -> None:
        """Place fields of `count` entries, of floats and of i32; on the CPU the entries of one index lie side by side."""
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
        """Allocate, after all fields are placed."""
        self._trees = [builder.finalize() for builder in self._builders.values()]

    def destroy(self) -> None:
        """Give the memory back."""
        for tree in self._trees:
            tree.destroy()
