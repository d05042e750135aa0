"""Panels in a window: the picture of a film's panels, drawn over the scene as points, as GGUI draws no image there."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.plots import Plot
from mpp_taichi.plots.sheet import Sheet, letters_for
from mpp_taichi.scene.spec import CameraSpec, RecordSpec
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.panels import Division, widened, widening
from mpp_taichi.views.pixel_points import PixelPoints


class WindowPanels:
    """Shows plots beside the scene; `shown` is toggled by the user.

    `export` writes the recorded curves into files, and returns a line with their names or with the error.
    """

    def __init__(self, plots: Sequence[Plot], record: RecordSpec, export: Callable[[], str]) -> None:
        """No panel is drawn yet."""
        self.plots, self.export = tuple(plots), export
        self.shown = bool(plots) and record.panels != "none"
        self.record = replace(record, panels="right") if record.panels == "none" else record
        self._size: tuple[int, int] | None = None
        self._sheet: Sheet | None = None
        self._last = np.zeros(0)
        self._points = PixelPoints()
        self._ground = _Ground()

    def division(self, size: tuple[int, int]) -> Division | None:
        """The division of a window of this size; None while no panels are shown."""
        return Division.of(size, self.record) if self.shown else None

    def toggle(self) -> None:
        """Show or hide the panels; where films have no panels, they are at the right."""
        self.shown = bool(self.plots) and not self.shown

    def aspect(self, size: tuple[int, int], camera: CameraSpec) -> float:
        """Width over height of the scene's part of the window."""
        division = self.division(size)
        width, height = size if division is None or widening(camera, size, division.scene) > 1.0 else division.scene
        return width / height

    @contextmanager
    def aside(self, camera: Camera, spec: CameraSpec, size: tuple[int, int]) -> Iterator[tuple[float, float]]:
        """A block in which the camera's picture for the scene's part is extended to the whole window.

        Yields the shift of the picture to the right and up, in halves of the window's height.
        """
        division = self.division(size)
        if division is None:
            yield 0.0, 0.0
            return
        angle = camera.field_of_view
        factor = widening(spec, size, division.scene) * size[1] / division.scene[1]
        camera.field_of_view, camera.height = widened(angle, factor), factor * camera.height
        try:
            yield (division.scene[0] - size[0]) / size[1], (size[1] - division.scene[1]) / size[1]
        finally:
            camera.field_of_view, camera.height = angle, camera.height / factor

    def draw(self, canvas: "ti.ui.Canvas", size: tuple[int, int], cursor: tuple[float, float]) -> None:
        """Put the panels on the canvas, over the scene; `cursor` in 0…1 from the lower left corner of the window."""
        division = self.division(size)
        if division is None:
            return
        if self._sheet is None or size != self._size:
            self._size = size
            self._sheet = Sheet(self.plots, division.panels, letters_for(size[1]))
            self._last = np.zeros(0)
        left, top = division.corner
        place = (cursor[0] * size[0] - left, (1.0 - cursor[1]) * size[1] - top)
        picture = self._sheet.picture(place)
        if not np.array_equal(picture, self._last):
            self._last = picture.copy()
            boxes = self._sheet.grounds()
            self._ground.put(boxes, (left, top), size)
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
