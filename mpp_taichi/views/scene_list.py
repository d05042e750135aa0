"""A list of scenes in a window, with buttons and arrow keys, with folders to walk through, and with room for a fault."""

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from mpp_taichi.views.marked_rows import MarkedRows

COLUMNS = 54  # letters of a line
ROW, LINE, HEAD = 23, 17, 32  # pixels: of a button, of a line of text, and of the panel's title with its rim
MESSAGE_LINES = 5
TEXT_LINES = MESSAGE_LINES + 2  # also the name of the place above the rows, and the hint below
HINT = "arrows and Enter, or a click"
INSIDE = "/"  # behind the name of a row that leads to a place
Box = tuple[float, float, float, float]


class Shelf(Protocol):
    """A folder, or another collection of scenes. Shelves that hold the same rows are equal."""

    @property
    def name(self) -> str:
        """The text above the rows."""

    def rows(self) -> "Sequence[ListRow]":
        """The rows as they are now; OSError where the place cannot be read."""


@dataclass(frozen=True)
class ListRow:
    """A row of the list: a file that can be opened, or a `place` to which the row leads."""

    name: str
    file: Path | None = None
    place: Shelf | None = None


class ListGui(Protocol):
    """The functions of GGUI's panel that the list uses."""

    def button(self, text: str) -> bool:
        """Draw a button, and return whether it was clicked."""

    def text(self, text: str) -> None:
        """Write a line."""


class SceneList:
    """The rows of a place, one of which is the scene `present` that runs now; `shown` is toggled by the user.

    Where the rows do not all fit, the rows around the marked row are shown. `title_of` gives the title of a scene's file.
    """

    def __init__(
        self, place: Shelf | None, present: Path | None = None, title_of: Callable[[Path], str] = lambda file: ""
    ) -> None:
        """The list is hidden at first; without a place it is empty."""
        self.place, self.present, self._title_of = place, present, title_of
        self._titles: dict[Path, str] = {}
        self.rows: Sequence[ListRow] = ()
        self.shown, self.message = False, ""
        self._marks = MarkedRows()
        self._chosen: Path | None = None

    def toggle(self) -> None:
        """Show the list with its present rows, or hide it."""
        self.shown = not self.shown
        if self.shown:
            self._titles = {}
            self._enter(self.place, self._is_present)

    def press(self, key: str) -> bool:
        """Take a pressed key; returns whether the key was meant for the list."""
        if not self.shown or key not in ("Up", "Down", "Left", "Right", "Return", "Escape"):
            return False
        if key == "Escape":
            self.shown = False
        elif key == "Return":
            self._choose(self.marked)
        elif key == "Left":
            self._leave()
        elif key == "Right":
            if self.rows and self.rows[self.marked].place is not None:
                self._choose(self.marked)
        else:
            self._marks.step(1 if key == "Down" else -1)
        return True

    @property
    def marked(self) -> int:
        """The number of the marked row."""
        return self._marks.marked

    def scroll(self, rows: int) -> None:
        """Move the mark by rows, not beyond the ends."""
        self._marks.scroll(rows)

    def take(self) -> Path | None:
        """The file that was chosen since the last call."""
        chosen, self._chosen = self._chosen, None
        return chosen

    def visible(self, height: int) -> range:
        """The numbers of the rows that fit into a window of this height in pixels."""
        return self._marks.visible((height - 16 - HEAD - LINE * TEXT_LINES) // ROW)

    def box(self, size: tuple[int, int]) -> Box:
        """Left, top, width and height of the panel as shares of the window, at its right rim."""
        width = min(7 * COLUMNS + 24, size[0] - 16)
        height = ROW * len(self.visible(size[1])) + LINE * TEXT_LINES + HEAD
        return 1.0 - (width + 8) / size[0], 8 / size[1], width / size[0], height / size[1]

    def draw(self, gui: ListGui, height: int) -> None:
        """Put the list into a window of GGUI."""
        gui.text("" if self.place is None else _ending(self.place.name))
        visible, clicked, rows = self.visible(height), None, len(self.rows)
        for number in visible:
            mark = ">" if number == self.marked else " "
            if gui.button(f"{mark} {self._text(self.rows[number])}"):
                clicked = number
        if len(visible) < rows:
            gui.text(f"{visible[0] + 1} to {visible[-1] + 1} of {rows}; {HINT}")
        else:
            gui.text(HINT if rows else "there is no scene in a file here")
        for line in textwrap.wrap(self.message, COLUMNS)[:MESSAGE_LINES]:
            gui.text(line)
        if clicked is not None:
            self._marks.marked = clicked
            self._choose(clicked)

    def _text(self, row: ListRow) -> str:
        if row.file is None:
            return row.name + INSIDE
        if row.file not in self._titles:
            self._titles[row.file] = self._title_of(row.file)
        title = self._titles[row.file]
        told = f"{title}   {row.name}" if title else row.name
        return told + ("  (runs)" if self._is_present(row) else "")

    def _is_present(self, row: ListRow) -> bool:
        return row.file is not None and self.present is not None and row.file.absolute() == self.present.absolute()

    def _choose(self, number: int) -> None:
        """Open the file of a row, or show the place to which the row leads."""
        if not self.rows:
            return
        row, left = self.rows[number], self.place
        if row.place is None:
            self._chosen = row.file
        else:
            self._enter(row.place, lambda each: each.place == left)

    def _leave(self) -> None:
        """Go to the place outside, to which the first row leads where there is such a place."""
        if self.rows and self.rows[0].place is not None and self.rows[0].name == "..":
            self._choose(0)

    def _enter(self, place: Shelf | None, is_marked: Callable[[ListRow], bool]) -> None:
        """Show a place; a place that cannot be read leaves the list as it is."""
        self.message = ""
        try:
            rows = () if place is None else tuple(place.rows())
        except OSError as error:
            self.message = f"{place.name if place else ''}: cannot be read: {error.strerror or error}"
            return
        self.place, self.rows = place, rows
        self._marks.begin(len(rows), next((number for number, row in enumerate(rows) if is_marked(row)), 0))


def _ending(text: str) -> str:
    return text if len(text) <= COLUMNS else "…" + text[1 - COLUMNS :]
