"""Pixels over a window's scene, as points: GGUI draws no image there."""

from typing import Any

import numpy as np
import taichi as ti

SPARE = 1.5  # times the number of points needed now: GGUI compiles its copy kernels anew for every field
RADIUS = 0.5  # pixels: a disc of this radius about the middle of a pixel covers that pixel and no other
NOWHERE = -2.0


class PixelPoints:
    """Pixels of a window as points: GGUI draws no image over the scene."""

    def __init__(self) -> None:
        """No point yet."""
        self._capacity = 0
        self.place: Any = None
        self.color: Any = None

    def draw(self, canvas: "ti.ui.Canvas", size: tuple[int, int]) -> None:
        """Put the points on the canvas, over all that is there."""
        if self._capacity:
            canvas.circles(self.place, radius=RADIUS / size[1], per_vertex_color=self.color)

    def put(self, rows: np.ndarray, columns: np.ndarray, colors: np.ndarray, size: tuple[int, int]) -> None:
        """Take pixels of a window of this size: rows from the top, columns, and colours (count, 3) as bytes."""
        if len(rows) > self._capacity:
            self._capacity = int(SPARE * len(rows))
            self.place = ti.Vector.field(2, ti.f32, self._capacity)
            self.color = ti.Vector.field(3, ti.f32, self._capacity)
        if self._capacity == 0:
            return
        place = np.full((self._capacity, 2), NOWHERE, np.float32)
        color = np.zeros((self._capacity, 3), np.float32)
        place[: len(rows), 0] = (columns + 0.5) / size[0]
        place[: len(rows), 1] = 1.0 - (rows + 0.5) / size[1]
        color[: len(rows)] = colors / 255.0
        self.place.from_numpy(place)
        self.color.from_numpy(color)
