"""A window without a scene: the list of scenes, from which the first scene is opened."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from mpp_taichi.errors import BackendError
from mpp_taichi.views.caption import DARK
from mpp_taichi.views.display_loss import DisplayLoss
from mpp_taichi.views.ggui_probe import probe
from mpp_taichi.views.glass import Glass
from mpp_taichi.views.paper import RIM, Mouse, Paper
from mpp_taichi.views.scene_list import SceneList, Shelf
from mpp_taichi.views.waiting import waiting_picture
from mpp_taichi.views.window_settings import KeptChanges, WindowSettings

TITLE = "mpp_taichi"
WIDTH, WORDS_WIDTH = 560, 120  # pixels: of the list, and of the keys beside it
WORDS = (
    ("arrows, wheel", "move the mark"),
    ("Enter, click", "open a scene or a folder"),
    ("left arrow", "back out of a folder"),
    ("N", "this list, while a scene runs"),
    ("H", "all keys, while a scene runs"),
    ("Q, Esc", "quit"),
)


class EmptyWindow:
    """Shows the list until a file of it is open, or the user closes the window.

    `open` prepares a file; the line that it returns states the error, if there is one. `glass` is the open window, which is
    handed on to the Window of the first scene.
    """

    def __init__(
        self,
        place: Shelf,
        title_of: Callable[[Path], str],
        open: Callable[[Path], str],
        loss: DisplayLoss,
        size: tuple[int, int] = (1280, 720),
        *,
        settings: WindowSettings,
    ) -> None:
        """Open the window, with the size and the place of the settings; `ti.init` has been called.

        Raises:
            BackendError: there is no display, or GGUI does not work on it.
        """
        if problem := probe(shown=True):
            raise BackendError(f"cannot open a window: {problem}")
        self._title_of, self._open = title_of, open
        with loss.in_glass():
            loss.require_display()
        self.glass = Glass(TITLE, settings.size or size, loss.in_glass, settings.place)
        self._kept = KeptChanges(settings, (), look_decided=False)
        self._list = SceneList(place, title_of=title_of)
        self._paper, self._words = Paper(), Paper()
        self._list.toggle()

    def run(self) -> bool:
        """Show the list; whether the window is handed on to a scene."""
        handed_on = False
        try:
            while self.glass.running and not handed_on:
                keys = self.glass.pressed()
                if "q" in keys or "Escape" in keys:
                    break
                for key in keys:
                    self._list.press(key)
                self._list.scroll(-self.glass.take_wheel())
                self._show("LMB" in keys)
                if (file := self._list.take()) is not None:
                    self.glass.put(waiting_picture(self._title_of(file) or file.name, self.glass.size, DARK))
                    self.glass.show()
                    self._list.message = self._open(file)
                    handed_on = not self._list.message
        finally:
            if not handed_on:
                self.glass.destroy()
        return handed_on

    def _show(self, down: bool) -> None:
        (width, height), (x, y) = self.glass.size, self.glass.cursor
        column = max(min(WIDTH, width), 1)
        self._paper.begin((column, max(height, 1)), Mouse((x * width, (1.0 - y) * height), down))
        self._list.draw(self._paper, height)
        whole = np.zeros((max(height, 1), max(width, 1), 3), np.uint8)
        whole[:, :column] = self._paper.picture()
        if width > column:
            self._words.begin((width - column, height), Mouse())
            self._words.text("Choose a scene.")
            self._words.space(RIM)
            for words in WORDS:
                self._words.row(words, (0, WORDS_WIDTH), faint=True)
            whole[:, column:] = self._words.picture()
        self.glass.put(whole)
        self.glass.show()
        self._kept.see(WindowSettings(size=(width, height), place=self.glass.place))
