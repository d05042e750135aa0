"""The X display beside GGUI: the size of the screen, the title of a window, and the mouse wheel, which GGUI does not offer.

A connection of its own to the X server; where there is no X (other systems, or Xlib is missing), `XDisplay.open` gives None.
"""

import ctypes
import os
import sys
from typing import Any

from mpp_taichi.views.x_full_screen import XFullScreen
from mpp_taichi.views.x_wheel import XWheel

CLIENT_LIST_DEPTH = 4  # windows of a window manager between the root and ours
UTF8 = "utf-8"
PROPERTY_MODE_REPLACE = 0
_ErrorHandler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)


class XDisplay:
    """A connection to the X server, and the window of this process, once it is found by its title."""

    def __init__(self, x11: Any, display: int) -> None:
        """Made by `open`."""
        self._x11, self._display = x11, display
        self._root = x11.XDefaultRootWindow(display)
        self._window: int | None = None
        self._wheel: XWheel | None = None
        self._full_screen = XFullScreen(x11, display, self._root, self._property)
        self._ignore = _ErrorHandler(lambda display, event: 0)

    @staticmethod
    def open() -> "XDisplay | None":
        """Connect to the display of the environment; None where there is none, or no Xlib."""
        if not sys.platform.startswith("linux") or not os.environ.get("DISPLAY"):
            return None
        try:
            x11 = _declared(ctypes.CDLL("libX11.so.6"))
        except OSError:
            return None
        display = x11.XOpenDisplay(None)
        return None if not display else XDisplay(x11, display)

    @property
    def screen(self) -> tuple[int, int]:
        """Width and height of the screen in pixels."""
        number = self._x11.XDefaultScreen(self._display)
        return self._x11.XDisplayWidth(self._display, number), self._x11.XDisplayHeight(self._display, number)

    def find(self, title: str) -> None:
        """Take the window of this process whose title begins with these words; its wheel is listened to from now on."""
        for window in self._below(self._root, CLIENT_LIST_DEPTH):
            if self._pid(window) == os.getpid() and self.title_of(window).startswith(title):
                self._window = window
                self._wheel = XWheel.open(self._x11, self._display, self._root)
                return

    @property
    def place(self) -> tuple[int, int] | None:
        """The upper left corner of the window on the screen, without its frame; None where there is no window."""
        if self._window is None:
            return None
        x, y, child = ctypes.c_int(), ctypes.c_int(), ctypes.c_ulong()
        places = (ctypes.byref(each) for each in (x, y, child))
        found = self._x11.XTranslateCoordinates(self._display, self._window, self._root, 0, 0, *places)
        return (x.value, y.value) if found else None

    def offers_full_screen(self) -> bool:
        """Whether the window is known, and a window manager runs that knows full screen."""
        return self._window is not None and self._full_screen.is_offered()

    def ask_full_screen(self, on: bool) -> None:
        """Ask the window manager that the window is, or is no longer, as large as the screen."""
        if self._window is not None:
            self._full_screen.ask(self._window, on)

    def rename(self, title: str) -> None:
        """Give the window a title, where it has another one: GGUI puts the old one back once a second."""
        if self._window is None or self.title_of(self._window) == title:
            return
        words = title.encode(UTF8)
        for name in (b"_NET_WM_NAME", b"_NET_WM_ICON_NAME", b"WM_NAME"):
            self._x11.XChangeProperty(
                self._display,
                self._window,
                self._x11.XInternAtom(self._display, name, 0),
                self._x11.XInternAtom(self._display, b"UTF8_STRING", 0),
                8,
                PROPERTY_MODE_REPLACE,
                words,
                len(words),
            )
        self._x11.XFlush(self._display)

    def take_wheel(self) -> int:
        """Clicks of the wheel away from the user, less the clicks towards the user, over the window since the last call."""
        clicks = 0 if self._wheel is None else self._wheel.take()
        return clicks if clicks and self._is_under_the_mouse() else 0

    def close(self) -> None:
        """End the connection."""
        self._x11.XCloseDisplay(self._display)
        self._window = self._wheel = None

    def title_of(self, window: int) -> str:
        """The title of a window; empty where it has none."""
        found = self._property(window, b"_NET_WM_NAME", b"UTF8_STRING")
        return "" if found is None else found.decode(UTF8, "replace")

    def _is_under_the_mouse(self) -> bool:
        """Whether the window, and no other above it, is where the mouse is."""
        window, answer = self._root, _Pointer()
        while self._x11.XQueryPointer(self._display, window, *answer.places) and answer.child.value:
            window = answer.child.value
            if window == self._window:
                return True
        return False

    def _below(self, window: int, depth: int) -> list[int]:
        root, parent, children, count = ctypes.c_ulong(), ctypes.c_ulong(), ctypes.POINTER(ctypes.c_ulong)(), ctypes.c_uint()
        before = self._x11.XSetErrorHandler(ctypes.cast(self._ignore, ctypes.c_void_p))  # a window may end meanwhile
        places = (ctypes.byref(each) for each in (root, parent, children, count))
        answered = self._x11.XQueryTree(self._display, window, *places)
        self._x11.XSetErrorHandler(before)
        found = [children[n] for n in range(count.value)] if answered else []
        if children:
            self._x11.XFree(children)
        return [*found, *(each for child in found for each in self._below(child, depth - 1))] if depth > 1 else found

    def _pid(self, window: int) -> int:
        found = self._property(window, b"_NET_WM_PID", b"CARDINAL")
        return -1 if found is None else int.from_bytes(found[:4], sys.byteorder)

    def _property(self, window: int, name: bytes, kind: bytes) -> bytes | None:
        """The bytes of a property of a window; None where it has no such property."""
        wanted = self._x11.XInternAtom(self._display, kind, 0)
        of_type, layout, count, left = ctypes.c_ulong(), ctypes.c_int(), ctypes.c_ulong(), ctypes.c_ulong()
        content = ctypes.POINTER(ctypes.c_ubyte)()
        before = self._x11.XSetErrorHandler(ctypes.cast(self._ignore, ctypes.c_void_p))
        places = (ctypes.byref(each) for each in (of_type, layout, count, left, content))
        atom = self._x11.XInternAtom(self._display, name, 0)
        failed = self._x11.XGetWindowProperty(self._display, window, atom, 0, 1024, 0, wanted, *places)
        self._x11.XSetErrorHandler(before)
        if failed or not content:
            return None
        # Xlib gives 4-byte numbers as longs.
        size = ctypes.sizeof(ctypes.c_long) if layout.value == 32 else layout.value // 8
        found = bytes(content[: count.value * size]) if of_type.value == wanted else None
        self._x11.XFree(content)
        return found


class _Pointer:
    """Room for an answer about the mouse."""

    def __init__(self) -> None:
        self.root, self.child = ctypes.c_ulong(), ctypes.c_ulong()
        self._numbers = [ctypes.c_int() for _ in range(4)]
        self._mask = ctypes.c_uint()
        self.places = [ctypes.byref(each) for each in (self.root, self.child, *self._numbers, self._mask)]


def _declared(x11: ctypes.CDLL) -> ctypes.CDLL:
    """The types of the functions that are called: ctypes takes every other argument for an int of 4 bytes."""
    pointer, window, atom, whole = ctypes.c_void_p, ctypes.c_ulong, ctypes.c_ulong, ctypes.c_int
    types: dict[str, tuple[Any, list[Any]]] = {
        "XOpenDisplay": (pointer, [ctypes.c_char_p]),
        "XCloseDisplay": (whole, [pointer]),
        "XDefaultRootWindow": (window, [pointer]),
        "XDefaultScreen": (whole, [pointer]),
        "XDisplayWidth": (whole, [pointer, whole]),
        "XDisplayHeight": (whole, [pointer, whole]),
        "XInternAtom": (atom, [pointer, ctypes.c_char_p, whole]),
        "XChangeProperty": (whole, [pointer, window, atom, atom, whole, whole, ctypes.c_char_p, whole]),
        "XGetWindowProperty": (whole, [pointer, window, atom, ctypes.c_long, ctypes.c_long, whole, atom, *5 * [pointer]]),
        "XQueryTree": (whole, [pointer, window, *4 * [pointer]]),
        "XQueryPointer": (whole, [pointer, window, *7 * [pointer]]),
        "XTranslateCoordinates": (whole, [pointer, window, window, whole, whole, *3 * [pointer]]),
        "XQueryExtension": (whole, [pointer, ctypes.c_char_p, *3 * [pointer]]),
        "XSetErrorHandler": (pointer, [pointer]),
        "XPending": (whole, [pointer]),
        "XNextEvent": (whole, [pointer, pointer]),
        "XGetEventData": (whole, [pointer, pointer]),
        "XFreeEventData": (None, [pointer, pointer]),
        "XSendEvent": (whole, [pointer, window, whole, ctypes.c_long, pointer]),
        "XFlush": (whole, [pointer]),
        "XFree": (whole, [pointer]),
    }
    for name, (result, arguments) in types.items():
        function = getattr(x11, name)
        function.restype, function.argtypes = result, arguments
    return x11
