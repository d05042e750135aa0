"""Panels in a window: the picture of a film's panels."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mpp_taichi.plots import Plot
from mpp_taichi.plots.sheet import Sheet, letters_for
from mpp_taichi.scene.spec import CameraSpec, RecordSpec
from mpp_taichi.views.canvas_layer import CanvasLayer
from mpp_taichi.views.glass import Glass
from mpp_taichi.views.panels import Division, widening
from mpp_taichi.views.window_layout import Area


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
        self._layer = CanvasLayer()

    def begin(self, shown: bool | None) -> None:
        """Show or hide the panels from the beginning on, where this is not None."""
        self.shown = bool(self.plots) and (self.shown if shown is None else shown)

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

    def picture(self, size: tuple[int, int], cursor: tuple[float, float]) -> np.ndarray | None:
        """The panels of a picture of this size; `cursor` in pixels from its upper left corner. None without panels."""
        division = self.division(size)
        if division is None:
            return None
        if self._sheet is None or size != self._size:
            self._size = size
            self._sheet = Sheet(self.plots, division.panels, letters_for(size[1]))
        left, top = division.corner
        return self._sheet.picture((cursor[0] - left, cursor[1] - top))

    def draw(self, glass: Glass, area: Area, picture: np.ndarray) -> None:
        """Put a picture of the panels into a window whose scene GGUI has drawn in an area."""
        division = self.division(area.size)
        if division is None or self._sheet is None:
            return
        corner = area.left + division.corner[0], area.top + division.corner[1]
        self._layer.draw(glass.canvas, glass.size, corner, picture, self._sheet.grounds())
