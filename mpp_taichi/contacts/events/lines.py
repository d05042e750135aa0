"""Memory of an event-driven run: the fields of a sphere lie in as few lines of the cache as possible."""

from typing import Any

import taichi as ti

LINE = 64  # bytes that a processor fetches at once


class Lines:
    """Makes fields of one entry per sphere, and places them line by line.

    A gas of many spheres waits for memory, and each line that an event needs is one more wait. Lines are aligned, for a tree
    of fields begins at a page.
    """

    def __init__(self, count: int) -> None:
        """Begin without any field, for `count` spheres."""
        self.count = count
        self._often: list[tuple[int, int, Any]] = []
        self._seldom: list[tuple[int, int, Any]] = []

    def field(self, kind: Any, components: int = 0, *, seldom: bool = False) -> Any:
        """Make a scalar or vector for each sphere. The fields made first share the first line; `seldom` fields come last."""
        result = ti.Vector.field(components, kind) if components else ti.field(kind)
        real = ti.lang.impl.current_cfg().default_fp if kind is float else kind
        size = 8 if real == ti.f64 else 4
        (self._seldom if seldom else self._often).append((size, size * max(components, 1), result))
        return result

    def place(self) -> Any:
        """Place each field in the first line that has room; returns the tree of the fields."""
        lines: list[list[tuple[int, int, Any]]] = []
        for entry in (*self._often, *self._seldom):
            line = next((line for line in lines if _used(line) + entry[1] <= LINE), None)
            if line is None:
                line = []
                lines.append(line)
            line.append(entry)
        builder = ti.FieldsBuilder()
        for line in lines:
            # The largest entries first, so that no entry needs a gap to be aligned.
            fields = [field for _, _, field in sorted(line, key=lambda entry: -entry[0])]
            room = (LINE - _used(line)) // 4
            if room and (line is not lines[-1] or _used(line) > LINE // 2):
                fields.append(ti.Vector.field(room, ti.i32))
            builder.dense(ti.i, self.count).place(*fields)
        return builder.finalize()


def _used(line: list[tuple[int, int, Any]]) -> int:
    return sum(size for _, size, _ in line)
