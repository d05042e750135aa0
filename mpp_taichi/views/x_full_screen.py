"""Full screen on an X display: a request to the window manager.  [Extended Window Manager Hints 1.5, _NET_WM_STATE]"""

import ctypes
import sys
from collections.abc import Callable
from typing import Any

CLIENT_MESSAGE = 33
SUBSTRUCTURE_MASKS = 1 << 19 | 1 << 20  # notify and redirect, which a window manager selects on the root
REMOVE, ADD = 0, 1
FROM_APPLICATION = 1
Property = Callable[[int, bytes, bytes], bytes | None]
"""The bytes of a property of a window, by its name and its type."""


class ClientMessage(ctypes.Structure):
    """`XClientMessageEvent` of Xlib, as large as any event."""

    _fields_ = [
        ("type", ctypes.c_int),
        ("serial", ctypes.c_ulong),
        ("send_event", ctypes.c_int),
        ("display", ctypes.c_void_p),
        ("window", ctypes.c_ulong),
        ("message_type", ctypes.c_ulong),
        ("format", ctypes.c_int),
        ("data", ctypes.c_long * 5),
        ("padding", ctypes.c_long * 24),
    ]


class XFullScreen:
    """Asks the window manager of a root window for full screen; `read` reads properties."""

    def __init__(self, x11: Any, display: int, root: int, read: Property) -> None:
        """Nothing is asked yet."""
        self._x11, self._display, self._root, self._read = x11, display, root, read

    def is_offered(self) -> bool:
        """Whether a window manager runs that knows full screen."""
        check = self._longs(self._root, b"_NET_SUPPORTING_WM_CHECK", b"WINDOW")
        alive = bool(check) and self._longs(check[0], b"_NET_SUPPORTING_WM_CHECK", b"WINDOW") == check  # not of one that ended
        return alive and self._atom(b"_NET_WM_STATE_FULLSCREEN") in self._longs(self._root, b"_NET_SUPPORTED", b"ATOM")

    def ask(self, window: int, on: bool) -> None:
        """Ask that a window is, or is no longer, as large as the screen."""
        message = ClientMessage(type=CLIENT_MESSAGE, window=window, message_type=self._atom(b"_NET_WM_STATE"), format=32)
        message.data[:4] = [ADD if on else REMOVE, self._atom(b"_NET_WM_STATE_FULLSCREEN"), 0, FROM_APPLICATION]
        self._x11.XSendEvent(self._display, self._root, 0, SUBSTRUCTURE_MASKS, ctypes.byref(message))
        self._x11.XFlush(self._display)

    def _atom(self, name: bytes) -> int:
        return int(self._x11.XInternAtom(self._display, name, 0))

    def _longs(self, window: int, name: bytes, kind: bytes) -> list[int]:
        found, size = self._read(window, name, kind) or b"", ctypes.sizeof(ctypes.c_long)
        places = range(0, len(found) - size + 1, size)
        return [int.from_bytes(found[place : place + size], sys.byteorder) for place in places]
