"""A sheet: all panels of a scene in one picture, in columns or rows."""

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image

from mpp_taichi.plots.content import Plot
from mpp_taichi.plots.cursor import read, with_reading
from mpp_taichi.plots.panel import Panel
from mpp_taichi.plots.theme import DARK, Rgb, Theme

LETTERS_PER_PICTURE = 48  # heights of a letter in the height of the picture: 15 pixels of 720
LEAST_LETTERS = 10
WIDEST = 0.55  # height over width of a panel: a flatter panel shares its row with another


class Sheet:
    """Panels side by side in an area of (width, height) pixels; `letters` is the height of their text."""

    MADE_ANEW = ("_picture",)  # for `archive.object_state`

    def __init__(
        self,
        plots: Sequence[Plot],
        size: tuple[int, int],
        letters: int,
        theme: Theme = DARK,
        *,
        columns: int | None = None,
    ) -> None:
        """Lay out the panels; without `columns`, in the number of columns that gives them the best shape."""
        self.size, self.theme = size, theme
        self.panels: list[Panel] = []
        self.corners: list[tuple[int, int]] = []
        rows, columns = (-(-len(plots) // columns), columns) if columns else arranged(len(plots), size)
        width, height = size
        for number, plot in enumerate(plots):
            row, column = number % rows, number // rows
            left, right = column * width // columns, (column + 1) * width // columns
            top, bottom = row * height // rows, (row + 1) * height // rows
            self.panels.append(Panel(plot, right - left, bottom - top, letters, theme))
            self.corners.append((left, top))
        self._picture = Image.new("RGB", size, theme.background)

    def grounds(self) -> list[tuple[tuple[int, int, int, int], Rgb]]:
        """Rectangles below the curves, the lowest first: left, top, right, bottom, and their colours."""
        found = [((0, 0, *self.size), self.theme.background)]
        for panel, (x, y) in zip(self.panels, self.corners):
            left, top, right, bottom = panel.frame.field
            found.append(((x + left, y + top, x + right, y + bottom), self.theme.field))
        return found

    def picture(self, cursor: tuple[float, float] | None = None) -> np.ndarray:
        """All panels as they are now, uint8, shape (height, width, 3); with the values at a place of the sheet [pixels]."""
        for panel, corner in zip(self.panels, self.corners):
            drawn = panel.picture()
            reading = read(panel, cursor[0] - corner[0], cursor[1] - corner[1]) if cursor is not None else None
            self._picture.paste(drawn if reading is None else with_reading(panel, drawn, reading), corner)
        return np.asarray(self._picture)


def arranged(count: int, size: tuple[int, int]) -> tuple[int, int]:
    """Rows and columns for a number of panels, so that each is as near as possible to the best shape."""
    width, height = size

    def strangeness(rows: int) -> float:
        columns = -(-count // rows)
        shape = (height / rows) / (width / columns)
        empty = rows * columns - count
        return abs(math.log(shape / WIDEST)) + 0.5 * empty

    rows = min(range(1, max(count, 1) + 1), key=strangeness)
    return rows, max(1, -(-count // rows))


def letters_for(rows: int) -> int:
    """Height of letters for a picture with a number of rows of pixels."""
    return max(LEAST_LETTERS, round(rows / LETTERS_PER_PICTURE))
