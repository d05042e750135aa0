"""Point grid: stands for a cell grid where no sphere has a radius, so that no two of them ever meet."""

from typing import Any

import taichi as ti

from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template


@ti.data_oriented
class PointGrid:
    """The points in the order of their indices, and no pair of them; with the fields and functions of a SphereGrid."""

    def __init__(self, particle_count: int, dimensions: int) -> None:
        """Allocate; needs a started Taichi."""
        self.particle_count = particle_count
        self.order, self.sorted_reach = ti.field(ti.i32), ti.field(float)
        self.sorted_position = ti.Vector.field(dimensions, float)
        self._memory = FieldGroup((particle_count, self.sorted_position, self.sorted_reach, self.order))

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    def build(self, position: Any, reach: Any, bounds: Any = None, skin: float = 0.0) -> None:
        """Note the places and reaches; there is nothing to sort."""
        self._note(position, reach, skin)

    @ti.kernel
    def _note(self, position: Template, reach: Template, skin: float):
        for i in range(self.particle_count):
            self.order[i] = i
            self.sorted_position[i] = position[i]
            self.sorted_reach[i] = reach[i] + skin

    @ti.func
    def visit(self, slot, task: Template, first, second):
        """No point has a partner."""

    @ti.func
    def visit_later(self, slot, task: Template, first, second):
        """No point has a partner."""
