"""The window of the operating system, opened by GGUI: its place on the screen, its title, its picture, and its input."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

import numpy as np
import taichi as ti
from taichi.ui.utils import get_field_info

from mpp_taichi.views.ggui import read_back
from mpp_taichi.views.ggui_folder import ggui_folder
from mpp_taichi.views.pace import FRAMES_PER_SECOND
from mpp_taichi.views.window_place import PLACE, fitted, windows_screen
from mpp_taichi.views.x_display import XDisplay

Guard = Callable[[], AbstractContextManager[None]]


class Glass:
    """An open window, which several scenes may use one after the other.

    The title may change while the window is open. `guard` is a block about each call of GGUI that may end the process, where
    the display has gone away.
    """

    def __init__(
        self,
        title: str,
        size: tuple[int, int],
        guard: Callable[[], AbstractContextManager[None]] = nullcontext,
        place: tuple[int, int] | None = None,
    ) -> None:
        """Open the window, within the screen, with its upper left corner at `place`; `ti.init` has been called."""
        self.guard, self.title = guard, title
        self.full = False  # screen
        self._x = XDisplay.open()
        self._pixels = np.zeros((0, 0), np.uint32)
        size, place = fitted(size, windows_screen() if self._x is None else self._x.screen, place or PLACE)
        with ggui_folder(), self.guard():
            self.window = ti.ui.Window(title, size, vsync=False, fps_limit=FRAMES_PER_SECOND, pos=place)
        if self._x is not None:
            self._x.find(title)

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
    def place(self) -> tuple[int, int] | None:
        """The upper left corner on the screen; None where it cannot be known."""
        return None if self._x is None else self._x.place

    def toggle_full_screen(self) -> str:
        """Fill the screen, or go back to the size before; returns a line where this is not possible."""
        if self._x is None or not self._x.offers_full_screen():
            return "full screen needs the window manager of an X display, which is not there"
        self.full = not self.full
        self._x.ask_full_screen(self.full)
        return ""

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

    def take_wheel(self) -> int:
        """Clicks of the mouse wheel away from the user, less the clicks towards the user, since the last call."""
        return 0 if self._x is None else self._x.take_wheel()

    def put(self, picture: np.ndarray) -> None:
        """Draw a picture (height, width, 3) over the whole canvas; nothing is compiled for it."""
        self._pixels = _columns_of(picture)  # GGUI reads them when it shows the canvas
        self.window.get_canvas().canvas.set_image(get_field_info(self._pixels))

    def show(self) -> None:
        """Show what was drawn, at most 60 times in a second."""
        with ggui_folder(), self.guard():
            self.window.show()
        if self._x is not None:
            self._x.rename(self.title)

    def read_back(self) -> np.ndarray:
        """The picture in the window, uint8, shape (height, width, 3); it empties the canvas."""
        with self.guard():
            return read_back(self.window)

    def destroy(self) -> None:
        """Close the window."""
        with ggui_folder():
            self.window.destroy()
        if self._x is not None:
            self._x.close()
            self._x = None


def _columns_of(picture: np.ndarray) -> np.ndarray:
    """Red | green << 8 | blue << 16 of every pixel, column by column from the lower left corner, as GGUI draws images."""
    packed = np.full((*picture.shape[:2], 4), 255, np.uint8)
    for k in range(3):  # one colour at a time is four times as fast as all colours together
        packed[:, :, k] = picture[:, :, k]
    return np.ascontiguousarray(packed.view(np.uint32)[::-1, :, 0].T)
