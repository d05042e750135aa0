"""The box in a window in which the integrator and the step of a scene are chosen."""

import textwrap
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mpp_taichi.views.marked_rows import MarkedRows
from mpp_taichi.views.scene_list import COLUMNS, HEAD, LINE, ROW, Box, ListGui

HINT = "arrows: integrator, step; Enter: begin anew"
MESSAGE_LINES = 6
BUTTONS_BELOW = 3
TEXT_LINES = MESSAGE_LINES + 2  # also the step above the rows, and the hint below
DIGITS = 6  # of the step
SLOW = 0.3  # seconds


@dataclass(frozen=True)
class Methods:
    """The integrators from which a scene may be given another one.

    names    of all integrators; `present` is the one that runs, with the step `dt`
    refusal  the reason why an integrator cannot run the scene with a step; empty where it can
    about    a line about an integrator
    choose   begin the scene anew with an integrator and a step; the line states the error, if there is one
    """

    names: Sequence[str]
    present: str
    dt: Callable[[], float]
    refusal: Callable[[str, float], str]
    about: Callable[[str], str]
    choose: Callable[[str, float], str]


class MethodBox:
    """The integrators and the step; `shown` is toggled by the user. Without `methods` it is never shown."""

    def __init__(self, methods: Methods | None) -> None:
        """The box is hidden at first."""
        self.methods = methods
        self.rows = MarkedRows()
        self.shown, self.message, self.dt = False, "", 1.0
        self._refusals: dict[str, str] = {}
        self._slow = False
        self._chosen: tuple[str, float] | None = None

    def toggle(self) -> None:
        """Show the box with the present integrator marked, or hide it."""
        self.shown = self.methods is not None and not self.shown
        if self.shown and self.methods is not None:
            self.dt, self.message = self.methods.dt(), ""
            self.rows.begin(len(self.methods.names), self.methods.names.index(self.methods.present))

    def press(self, key: str) -> bool:
        """Take a pressed key; returns whether the key was meant for the box."""
        if not self.shown or key not in ("Up", "Down", "Left", "Right", "Return", "Escape"):
            return False
        if key == "Escape":
            self.shown = False
        elif key == "Return":
            self._choose()
        elif key in ("Left", "Right"):
            self._scale(2.0 if key == "Right" else 0.5)
        else:
            self.rows.step(1 if key == "Down" else -1)
            self.message = ""
        return True

    def scroll(self, rows: int) -> None:
        """Move the mark by rows, not beyond the ends."""
        self.rows.scroll(rows)

    def look(self) -> None:
        """Find out of one more integrator whether it can run the scene: each frame of the window has time for one of them.

        Where this takes long, as in a scene with a long list of bodies, only the marked integrator is looked at.
        """
        if self.shown and self.methods is not None:
            order = [self._marked] if self._slow else [self._marked, *self.methods.names]
            name = next((name for name in order if name not in self._refusals), None)
            if name is not None:
                began = time.perf_counter()
                self._refusals[name] = self.methods.refusal(name, self.methods.dt())
                self._slow = time.perf_counter() - began > SLOW

    def take(self) -> tuple[str, float] | None:
        """The integrator and the step that were chosen since the last call."""
        chosen, self._chosen = self._chosen, None
        return chosen

    def told(self) -> str:
        """The integrator that runs and its step."""
        return "" if self.methods is None else f"{self.methods.present}, dt = {self.methods.dt():.{DIGITS}g}"

    def room(self, height: int) -> int:
        """The number of rows for which there is room in a window of this height in pixels."""
        return (height - 16 - HEAD - LINE * TEXT_LINES) // ROW - BUTTONS_BELOW

    def box(self, size: tuple[int, int]) -> Box:
        """Left, top, width and height of the panel as shares of the window, at its right rim."""
        width = min(7 * COLUMNS + 24, size[0] - 16)
        rows = len(self.rows.visible(self.room(size[1])))
        height = ROW * (rows + BUTTONS_BELOW) + LINE * TEXT_LINES + HEAD
        return 1.0 - (width + 8) / size[0], 8 / size[1], width / size[0], height / size[1]

    def draw(self, gui: ListGui, height: int) -> None:
        """Put the box into a window of GGUI."""
        if self.methods is None:
            return
        gui.text("integrator and step")
        visible, clicked = self.rows.visible(self.room(height)), None
        for number in visible:
            if gui.button(self._text(number)):
                clicked = number
        if gui.button(f"half the step: dt = {0.5 * self.dt:.{DIGITS}g}"):
            self._scale(0.5)
        if gui.button(f"twice the step: dt = {2.0 * self.dt:.{DIGITS}g}"):
            self._scale(2.0)
        if gui.button(f"begin anew with {self._marked}, dt = {self.dt:.{DIGITS}g}"):
            self._choose()
        gui.text(HINT)
        told = self.message or self._refusals.get(self._marked) or self.methods.about(self._marked)
        for line in textwrap.wrap(told, COLUMNS)[:MESSAGE_LINES]:
            gui.text(line)
        if clicked is not None:
            self.rows.marked, self.message = clicked, ""

    @property
    def _marked(self) -> str:
        return "" if self.methods is None else self.methods.names[self.rows.marked]

    def _text(self, number: int) -> str:
        assert self.methods is not None
        name = self.methods.names[number]
        told = "  (runs)" if name == self.methods.present else "  (cannot run this scene)" if self._refusals.get(name) else ""
        return f"{'>' if number == self.rows.marked else ' '} {name}{told}"

    def _scale(self, factor: float) -> None:
        self.dt, self.message = float(f"{factor * self.dt:.{DIGITS}g}"), ""

    def _choose(self) -> None:
        self._chosen = self._marked, self.dt
