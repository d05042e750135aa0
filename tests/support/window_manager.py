"""A window manager of a virtual display that can do one thing: make a window as large as the screen, and small again."""

import ctypes
import time

SUBSTRUCTURE_NOTIFY = 1 << 19
CLIENT_MESSAGE = 33
WINDOW_TYPE, ATOM_TYPE = 33, 4  # predefined atoms XA_WINDOW and XA_ATOM


class WindowManager:
    """Announces itself on a display by the properties of EWMH, and answers requests for full screen.

    Without `supports` it announces itself as one that knows no full screen.
    """

    def __init__(self, display: str, *, supports: bool = True) -> None:
        self.x11 = x11 = ctypes.CDLL("libX11.so.6")
        window, pointer, whole = ctypes.c_ulong, ctypes.c_void_p, ctypes.c_int
        for name, result, arguments in (
            ("XOpenDisplay", pointer, [ctypes.c_char_p]),
            ("XDefaultRootWindow", window, [pointer]),
            ("XInternAtom", window, [pointer, ctypes.c_char_p, whole]),
            ("XCreateSimpleWindow", window, [pointer, window, *6 * [whole], window]),
            ("XChangeProperty", whole, [pointer, window, window, window, whole, whole, pointer, whole]),
            ("XSelectInput", whole, [pointer, window, ctypes.c_long]),
            ("XPending", whole, [pointer]),
            ("XNextEvent", whole, [pointer, pointer]),
            ("XMoveResizeWindow", whole, [pointer, window, *4 * [whole]]),
            ("XSync", whole, [pointer, whole]),
            ("XCloseDisplay", whole, [pointer]),
        ):
            function = getattr(x11, name)
            function.restype, function.argtypes = result, arguments
        self.display = x11.XOpenDisplay(display.encode())
        self.root = x11.XDefaultRootWindow(self.display)
        self.full = self.atom("_NET_WM_STATE_FULLSCREEN")
        own = x11.XCreateSimpleWindow(self.display, self.root, 0, 0, 1, 1, 0, 0, 0)
        for each in (self.root, own):
            self.put(each, "_NET_SUPPORTING_WM_CHECK", WINDOW_TYPE, [own])
        atoms = [self.atom("_NET_WM_STATE"), *([self.full] if supports else [])]
        self.put(self.root, "_NET_SUPPORTED", ATOM_TYPE, atoms)
        x11.XSelectInput(self.display, self.root, SUBSTRUCTURE_NOTIFY)
        x11.XSync(self.display, 0)

    def atom(self, name: str) -> int:
        return self.x11.XInternAtom(self.display, name.encode(), 0)

    def put(self, window: int, name: str, kind: int, values: list[int]) -> None:
        content = (ctypes.c_long * len(values))(*values)
        self.x11.XChangeProperty(self.display, window, self.atom(name), kind, 32, 0, content, len(values))

    def answer(self, window: int, large: tuple[int, ...], small: tuple[int, ...], seconds: float = 10.0) -> bool:
        """Wait for the next request of a window, and give it the place and size for it; whether it asked for full screen."""
        event, deadline = (ctypes.c_long * 24)(), time.monotonic() + seconds
        while time.monotonic() < deadline:
            while self.x11.XPending(self.display):
                self.x11.XNextEvent(self.display, event)
                kind = event[0] & 0xFFFFFFFF
                if kind == CLIENT_MESSAGE and event[4] == window and event[5] == self.atom("_NET_WM_STATE"):
                    assert event[8] == self.full
                    self.x11.XMoveResizeWindow(self.display, window, *(large if event[7] else small))
                    self.x11.XSync(self.display, 0)
                    return bool(event[7])
            time.sleep(0.02)
        raise AssertionError("nothing was asked of the window manager")

    def close(self) -> None:
        """End, and take the window with it by which others know that it runs."""
        self.x11.XCloseDisplay(self.display)
