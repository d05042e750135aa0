"""A list of scenes in a window, with buttons and arrow keys, and with room for the fault of a chosen scene."""

import textwrap
from collections.abc import Callable, Sequence
from typing import Protocol

COLUMNS = 54  # letters of a line
ROW, LINE, HEAD = 23, 17, 32  # pixels: of a button, of a line of text, and of the panel's title with its rim
MESSAGE_LINES = 5
HINT = "arrows and Enter, or a click"
Box = tuple[float, float, float, float]


class ListGui(Protocol):
    """The functions of GGUI's panel that the list uses."""

    def button(self, text: str) -> bool:
        """Draw a button, and return whether it was clicked."""

    def text(self, text: str) -> None:
        """Write a line."""


class SceneList:
    """The scenes that `names()` returns, of which `present` runs now; `shown` is toggled by the user.

    Where the names do not all fit, the names around the marked name are shown. `title_of` gives the title of a scene.
    """

    def __init__(self, names: Callable[[], Sequence[str]], present: str, title_of: Callable[[str], str] = str) -> None:
        """The list is hidden at first."""
        self._find, self.present, self._title_of = names, present, title_of
        self._titles: dict[str, str] = {}
        self.names: Sequence[str] = ()
        self.shown, self.marked, self.message = False, 0, ""
        self._chosen: str | None = None

    def toggle(self) -> None:
        """Show the list with its present names, or hide it."""
        self.shown = not self.shown
        if self.shown:
            self.names, self.message = tuple(self._find()), ""
            self._titles = {name: self._title_of(name) for name in self.names}
            self.marked = self.names.index(self.present) if self.present in self.names else 0

    def press(self, key: str) -> bool:
        """Take a pressed key; returns whether the key was meant for the list."""
        if not self.shown or key not in ("Up", "Down", "Return", "Escape"):
            return False
        if key == "Escape":
            self.shown = False
        elif key == "Return":
            self._chosen = self.names[self.marked] if self.names else None
        elif self.names:
            self.marked = (self.marked + (1 if key == "Down" else -1)) % len(self.names)
        return True

    def scroll(self, rows: int) -> None:
        """Move the mark by rows, not beyond the ends."""
        self.marked = min(max(self.marked + rows, 0), max(len(self.names) - 1, 0))

    def take(self) -> str | None:
        """The name that was chosen since the last call."""
        chosen, self._chosen = self._chosen, None
        return chosen

    def rows(self, height: int) -> int:
        """The number of names that fit into a window of this height in pixels."""
        room = height - 16 - HEAD - LINE * (MESSAGE_LINES + 1)
        return max(1, min(len(self.names), room // ROW))

    def box(self, size: tuple[int, int]) -> Box:
        """Left, top, width and height of the panel as shares of the window, at its right rim."""
        width = min(7 * COLUMNS + 24, size[0] - 16)
        height = ROW * self.rows(size[1]) + LINE * (MESSAGE_LINES + 1) + HEAD
        return 1.0 - (width + 8) / size[0], 8 / size[1], width / size[0], height / size[1]

    def visible(self, height: int) -> Sequence[str]:
        """The names that are shown."""
        rows = self.rows(height)
        first = min(max(0, self.marked - rows // 2), max(0, len(self.names) - rows))
        return self.names[first : first + rows]

    def draw(self, gui: ListGui, height: int) -> None:
        """Put the list into a window of GGUI."""
        visible = self.visible(height)
        for name in visible:
            mark = ">" if name == self.names[self.marked] else " "
            title = self._titles.get(name, name)
            told = name if title == name else f"{title}   {name}"
            if gui.button(f"{mark} {told}{'  (runs)' if name == self.present else ''}"):
                self.marked, self._chosen = self.names.index(name), name
        if len(visible) < len(self.names):
            first = self.names.index(visible[0]) + 1
            gui.text(f"{first} to {first + len(visible) - 1} of {len(self.names)}; {HINT}")
        else:
            gui.text(HINT if self.names else "there is no scene in a file here")
        for line in textwrap.wrap(self.message, COLUMNS)[:MESSAGE_LINES]:
            gui.text(line)
