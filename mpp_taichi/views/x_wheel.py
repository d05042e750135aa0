"""The mouse wheel on an X display, by XInput 2: GGUI keeps its clicks to itself."""

import ctypes
from typing import Any

GENERIC_EVENT = 35
RAW_BUTTON_PRESS = 15
ALL_MASTER_DEVICES = 1
WHEEL_UP, WHEEL_DOWN = 4, 5  # buttons of X


_HEAD: list[tuple[str, Any]] = [  # of every event of an extension
    ("type", ctypes.c_int),
    ("serial", ctypes.c_ulong),
    ("send_event", ctypes.c_int),
    ("display", ctypes.c_void_p),
    ("extension", ctypes.c_int),
    ("evtype", ctypes.c_int),
]


class _EventMask(ctypes.Structure):
    _fields_ = [("deviceid", ctypes.c_int), ("mask_len", ctypes.c_int), ("mask", ctypes.POINTER(ctypes.c_ubyte))]


class _Cookie(ctypes.Structure):
    _fields_ = [
        *_HEAD,
        ("cookie", ctypes.c_uint),
        ("data", ctypes.c_void_p),
        ("padding", ctypes.c_long * 24),
    ]


class _RawEvent(ctypes.Structure):
    _fields_ = [
        *_HEAD,
        ("time", ctypes.c_ulong),
        ("deviceid", ctypes.c_int),
        ("sourceid", ctypes.c_int),
        ("detail", ctypes.c_int),
    ]


class XWheel:
    """Clicks of the wheel anywhere on the screen, by XInput 2."""

    def __init__(self, x11: Any, xi: Any, display: int, extension: int) -> None:
        self._x11, self._xi, self._display, self._extension = x11, xi, display, extension

    @staticmethod
    def open(x11: Any, display: int, root: int) -> "XWheel | None":
        """Listen; None where the server or the library is missing or too old."""
        try:
            xi = ctypes.CDLL("libXi.so.6")
        except OSError:
            return None
        xi.XIQueryVersion.argtypes = [ctypes.c_void_p, ctypes.POINTER(ctypes.c_int), ctypes.POINTER(ctypes.c_int)]
        xi.XISelectEvents.argtypes = [ctypes.c_void_p, ctypes.c_ulong, ctypes.POINTER(_EventMask), ctypes.c_int]
        extension, event, error = ctypes.c_int(), ctypes.c_int(), ctypes.c_int()
        numbers = (ctypes.byref(each) for each in (extension, event, error))
        if not x11.XQueryExtension(display, b"XInputExtension", *numbers):
            return None
        major, minor = ctypes.c_int(2), ctypes.c_int(0)
        if xi.XIQueryVersion(display, ctypes.byref(major), ctypes.byref(minor)):
            return None
        bits = (ctypes.c_ubyte * 4)()
        bits[RAW_BUTTON_PRESS // 8] |= 1 << RAW_BUTTON_PRESS % 8
        mask = _EventMask(ALL_MASTER_DEVICES, len(bits), ctypes.cast(bits, ctypes.POINTER(ctypes.c_ubyte)))
        if xi.XISelectEvents(display, root, ctypes.byref(mask), 1):
            return None
        x11.XFlush(display)
        return XWheel(x11, xi, display, extension.value)

    def take(self) -> int:
        """Clicks away from the user, less the clicks towards the user, since the last call."""
        clicks, event = 0, _Cookie()
        while self._x11.XPending(self._display):
            self._x11.XNextEvent(self._display, ctypes.byref(event))
            ours = event.type == GENERIC_EVENT and event.extension == self._extension
            if ours and self._x11.XGetEventData(self._display, ctypes.byref(event)):
                button = ctypes.cast(event.data, ctypes.POINTER(_RawEvent)).contents.detail
                clicks += (button == WHEEL_UP) - (button == WHEEL_DOWN)
                self._x11.XFreeEventData(self._display, ctypes.byref(event))
        return clicks
