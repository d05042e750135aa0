"""Panels beside the scene: how a picture is divided, and a view that fills both parts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mpp_taichi.plots import Plot
from mpp_taichi.plots.sheet import Sheet, letters_for
from mpp_taichi.scene.spec import CameraSpec, RecordSpec, ViewSpec
from mpp_taichi.views._base import Frame, View
from mpp_taichi.views.caption import draw_caption

LEAST = 16  # pixels of each part


@dataclass(frozen=True)
class Division:
    """A picture of (width, height) pixels in two parts: the scene above or to the left, panels below or to the right."""

    scene: tuple[int, int]
    panels: tuple[int, int]
    right: bool

    @staticmethod
    def of(size: tuple[int, int], record: RecordSpec) -> "Division | None":
        """The division that `record:` asks for; None without panels."""
        if record.panels == "none":
            return None
        width, height = size
        right = record.panels == "right"
        whole = width if right else height
        share = min(max(round(record.panel_share * whole), LEAST), max(whole - LEAST, 1))
        if right:
            return Division((width - share, height), (share, height), True)
        return Division((width, height - share), (width, share), False)

    @property
    def corner(self) -> tuple[int, int]:
        """Column and row at which the panels begin."""
        return (self.scene[0], 0) if self.right else (0, self.scene[1])


class ViewWithPanels(View):
    """A view of the scene in one part of the picture, and panels in the other."""

    MADE_ANEW = ("_picture",)  # for `archive.object_state`

    def __init__(self, view: View, plots: Sequence[Plot], division: Division, *, caption: bool) -> None:
        """`view` draws the scene's part without a caption; the caption is as large as in a picture of the whole size."""
        self.view, self.division, self.caption = view, division, caption
        (width, height), (wide, high) = division.scene, division.panels
        size = (width + wide, height) if division.right else (width, height + high)
        self._picture = np.zeros((size[1], size[0], 3), np.uint8)
        self._sheet = Sheet(plots, division.panels, letters_for(size[1]))

    def draw(self, frame: Frame) -> np.ndarray:
        """The picture; a new array each time."""
        (width, height), (left, top) = self.division.scene, self.division.corner
        picture = self._picture.copy()
        picture[:height, :width] = self.view.draw(frame)
        picture[top:, left:] = self._sheet.picture()
        if self.caption:
            draw_caption(picture, frame)
        return picture

    def close(self) -> None:
        """Close the view."""
        self.view.close()


def widening(camera: CameraSpec, before: tuple[int, int], after: tuple[int, int]) -> float:
    """Factor by which a camera's field must grow so that a part of the picture shows everything that the whole showed.

    The factor is 1 for a camera that chooses its own place, since it fits any shape.
    """
    chosen = camera.position is None and camera.height is None
    return 1.0 if chosen else max(1.0, (before[0] / before[1]) / (after[0] / after[1]))


def widened(field_of_view: float, factor: float) -> float:
    """The vertical angle that shows a height larger by a factor [degrees]."""
    return math.degrees(2.0 * math.atan(factor * math.tan(math.radians(field_of_view) / 2.0)))


def narrowed(view: ViewSpec, before: tuple[int, int], after: tuple[int, int]) -> ViewSpec:
    """The view for a picture of another shape."""
    factor, camera = widening(view.camera, before, after), view.camera
    if factor == 1.0:
        return view
    changed: CameraSpec = replace(
        camera,
        field_of_view=widened(camera.field_of_view, factor),
        height=None if camera.height is None else factor * camera.height,
    )
    return replace(view, camera=changed)
