"""Fields that are allocated together, and freed together."""

from typing import Any

import taichi as ti

Row = tuple[Any, ...]  # a count, and the fields of so many entries; fields of a tuple lie side by side, entry by entry


class FieldGroup:
    """The memory of some fields, in one tree for numbers of 4 bytes and one for numbers of 8 bytes.

    In a tree with 4-byte numbers, 8-byte numbers may lie across their alignment, and on Vulkan they share bytes with others.

        memory = FieldGroup((count, self.mass, self.radius), (1, self.total))
        memory.destroy()
    """

    def __init__(self, *rows: Row) -> None:
        """Allocate all fields; needs a started Taichi."""
        builders: dict[int, Any] = {}
        for count, *parts in rows:
            for part in parts:
                fields = part if isinstance(part, tuple) else (part,)
                width = 4 if fields[0].dtype in (ti.f32, ti.i32, ti.u32) else 8
                if width not in builders:
                    builders[width] = ti.FieldsBuilder()
                builders[width].dense(ti.i, count).place(*fields)
        self._trees = [builder.finalize() for builder in builders.values()]

    def destroy(self) -> None:
        """Free the memory; the fields must not be used any more."""
        for tree in self._trees:
            tree.destroy()
