"""The window of the operating system, opened by GGUI: its place on the screen, its title, its picture, and its input."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

import numpy as np
import taichi as ti

from mpp_taichi.views.ggui import read_back
from mpp_taichi.views.ggui_folder import ggui_folder

FRAMES_PER_SECOND = 60
Guard = Callable[[], AbstractContextManager[None]]


class Glass:
    """An open window, which several scenes may use one after the other.

    `guard` is a block about each call of GGUI that may end the process, where the display has gone away.
    """

    def __init__(
        self, title: str, size: tuple[int, int], guard: Callable[[], AbstractContextManager[None]] = nullcontext
    ) -> None:
        """Open the window; `ti.init` has been called."""
        self.guard = guard
        with ggui_folder(), self.guard():
            self.window = ti.ui.Window(title, size, vsync=False, fps_limit=FRAMES_PER_SECOND)

    @property
    def running(self) -> bool:
        """Whether the user has not closed the window."""
        return bool(self.window.running)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        width, height = self.window.get_window_shape()
        return int(width), int(height)

    @property
    def canvas(self) -> "ti.ui.Canvas":
        """GGUI's canvas."""
        return self.window.get_canvas()

    @property
    def cursor(self) -> tuple[float, float]:
        """The place of the mouse, in 0…1 from the lower left corner."""
        x, y = self.window.get_cursor_pos()
        return float(x), float(y)

    def pressed(self) -> list[str]:
        """Keys and buttons that went down since the last call."""
        return [event.key for event in self.window.get_events(ti.ui.PRESS)]

    def held(self, keys: tuple[str, ...]) -> set[str]:
        """The keys among these that are down now."""
        return {key for key in keys if self.window.is_pressed(key)}

    def show(self) -> None:
        """Show what was drawn, at most 60 times in a second."""
        with ggui_folder(), self.guard():
            self.window.show()

    def read_back(self) -> np.ndarray:
        """The picture in the window, uint8, shape (height, width, 3); it empties the canvas."""
        with self.guard():
            return read_back(self.window)

    def destroy(self) -> None:
        """Close the window."""
        with ggui_folder():
            self.window.destroy()
