"""A picture over a scene that GGUI has drawn: GGUI draws no image there, so it is rectangles and points."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.views.pixel_points import PixelPoints

Boxes = Sequence[tuple]
"""Rectangles below a picture's lines and letters, the lowest first: left, top, right and bottom [pixels], and the colour."""


class CanvasLayer:
    """One picture, which is handed over anew only when it has changed."""

    def __init__(self) -> None:
        """Nothing is drawn yet."""
        self._last: tuple[tuple[int, int], tuple[int, int], np.ndarray] | None = None
        self._points = PixelPoints()
        self._ground = _Ground()

    def draw(
        self, canvas: "ti.ui.Canvas", size: tuple[int, int], corner: tuple[int, int], picture: np.ndarray, boxes: Boxes
    ) -> None:
        """Put a picture on the canvas of a window of this size, with its upper left corner at a pixel of the window."""
        last = self._last
        if last is None or last[:2] != (size, corner) or not np.array_equal(last[2], picture):
            self._last = size, corner, picture.copy()
            left, top = corner
            self._ground.put(boxes, corner, size)
            rows, columns = _drawn(picture, boxes)
            self._points.put(top + rows, left + columns, picture[rows, columns], size)
        canvas.triangles(self._ground.corner, per_vertex_color=self._ground.color)
        self._points.draw(canvas, size)


def _drawn(picture: np.ndarray, boxes: Sequence[tuple]) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels that differ from the rectangles below them."""
    ground = np.zeros_like(picture)
    for (left, top, right, bottom), color in boxes:
        ground[top:bottom, left:right] = color
    red, green, blue = np.moveaxis(picture != ground, 2, 0)
    rows, columns = np.nonzero(red | green | blue)
    return rows, columns


class _Ground:
    """Rectangles of one colour each, as two triangles."""

    def __init__(self) -> None:
        self.corner: Any = None
        self.color: Any = None

    def put(self, boxes: Sequence[tuple], origin: tuple[int, int], size: tuple[int, int]) -> None:
        if self.corner is None or self.corner.shape[0] != 6 * len(boxes):
            self.corner = ti.Vector.field(2, ti.f32, 6 * len(boxes))
            self.color = ti.Vector.field(3, ti.f32, 6 * len(boxes))
        corners, colors = [], []
        for (left, top, right, bottom), color in boxes:
            x0, x1 = (origin[0] + left) / size[0], (origin[0] + right) / size[0]
            y0, y1 = 1.0 - (origin[1] + top) / size[1], 1.0 - (origin[1] + bottom) / size[1]
            corners += [(x0, y0), (x1, y0), (x1, y1), (x0, y0), (x1, y1), (x0, y1)]
            colors += [color] * 6
        self.corner.from_numpy(np.array(corners, np.float32))
        self.color.from_numpy(np.array(colors, np.float32) / 255.0)
