"""The picked particle in a window, and a ring around it where GGUI draws the scene."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.views.picking import CORNERS, Discs, ring

COLOR = (0.9, 0.62, 0.0)  # orange of Okabe and Ito
RING_WIDTH = 2.0  # pixels


class WindowMark:
    """Marks the particle `index`; None marks no particle."""

    def __init__(self) -> None:
        """No particle is picked at first."""
        self.index: int | None = None
        self._ends: Any = None

    def draw(self, canvas: "ti.ui.Canvas", drawn: Discs, size: tuple[int, int]) -> None:
        """Put the ring on the canvas, over the scene."""
        if self.index is None or self.index >= len(drawn.depth):
            return
        ends = ring(drawn, self.index, size)
        if not np.isfinite(ends).all():
            return
        if self._ends is None:
            self._ends = ti.Vector.field(2, ti.f32, 2 * CORNERS)
        self._ends.from_numpy(ends.astype(np.float32))
        canvas.lines(self._ends, RING_WIDTH / size[1], color=COLOR)
