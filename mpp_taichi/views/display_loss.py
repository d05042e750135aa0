"""The loss of a display: its server ends, or the connection to it breaks, while a window is open.

Xlib then ends the process (`exit(1)`), and so does Taichi (an assertion, `abort()`), in the midst of a call of C, out of which
no exception of Python can come. Handlers of both save what there is to save, and end the process well.
"""

import ctypes
import os
import select
import signal
import socket
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import TracebackType

from mpp_taichi.errors import BackendError

X_PORTS = range(6000, 6064)  # of X servers that are reached by TCP, also through a tunnel
STANDARD_STREAMS = 3  # descriptors 0 to 2: a service may have sockets there
_XlibHandler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)
_SignalHandler = ctypes.CFUNCTYPE(None, ctypes.c_int)


class DisplayLoss:
    """A block in which the loss of an X display calls `rescue`, and ends the process with the code that it returns.

    `rescue` is given the name of the display. It is called within a call of Xlib or Vulkan, so it must launch no kernel and
    draw nothing. On systems without X the block does nothing.
    """

    def __init__(self, rescue: Callable[[str], int]) -> None:
        """Nothing is watched yet."""
        self._rescue = rescue
        self._in_xlib = _XlibHandler(self._broken)
        self._in_abort = _SignalHandler(self._aborted)
        self._xlib = _library("libX11.so.6")
        self._libc = _library(None)
        self._before: int | None = None
        self._folder = "."

    def __enter__(self) -> "DisplayLoss":
        """Answer Xlib."""
        self._folder = os.getcwd()
        if self._xlib is not None:
            self._before = self._set_in_xlib(ctypes.cast(self._in_xlib, ctypes.c_void_p).value)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Put back the handler that was there."""
        if self._xlib is not None:
            self._set_in_xlib(self._before)

    def require_display(self) -> None:
        """Ask for the display once more: GGUI ends the process where it has gone away since GGUI was tried.

        Raises:
            BackendError: the X display does not answer.
        """
        if self._xlib is None or not (name := os.environ.get("DISPLAY")):
            return
        self._xlib.XOpenDisplay.argtypes, self._xlib.XOpenDisplay.restype = [ctypes.c_char_p], ctypes.c_void_p
        self._xlib.XCloseDisplay.argtypes = [ctypes.c_void_p]
        connection = self._xlib.XOpenDisplay(None)
        if connection is None:
            raise BackendError(f"cannot open a window: the display {name} has gone away")
        self._xlib.XCloseDisplay(connection)

    @contextmanager
    def in_glass(self) -> Iterator[None]:
        """A block of calls of GGUI: an abort within it is answered where a connection has broken.

        Elsewhere an abort stays as it is: another thread may cause it while the main thread waits for that thread in C, and a
        handler of Python would wait for the main thread.
        """
        if self._libc is None:
            yield
            return
        if a_connection_is_broken():  # before Taichi tells its assertion
            self._broken(None)
        before = self._set_in_abort(ctypes.cast(self._in_abort, ctypes.c_void_p).value)
        try:
            yield
        finally:
            self._set_in_abort(before)

    def _broken(self, display: int | None) -> int:
        """Xlib's handler of a broken connection, from which it must not return."""
        code = 1
        try:
            os.chdir(self._folder)  # GGUI is called in another folder
            code = self._rescue(os.environ.get("DISPLAY", ""))
        finally:
            os._exit(code)

    def _aborted(self, number: int) -> None:
        """The handler of `abort()`, which ends the process when this returns."""
        if a_connection_is_broken():
            self._broken(None)

    def _set_in_xlib(self, handler: int | None) -> int | None:
        assert self._xlib is not None
        set_handler = self._xlib.XSetIOErrorHandler
        set_handler.argtypes, set_handler.restype = [ctypes.c_void_p], ctypes.c_void_p
        before: int | None = set_handler(handler)
        return before

    def _set_in_abort(self, handler: int | None) -> int | None:
        assert self._libc is not None
        set_handler = self._libc.signal
        set_handler.argtypes, set_handler.restype = [ctypes.c_int, ctypes.c_void_p], ctypes.c_void_p
        before: int | None = set_handler(signal.SIGABRT, handler)
        return before


def a_connection_is_broken() -> bool:
    """Whether the other end of a socket of this process that leads to a display server is closed."""
    poll = select.poll()
    for name in os.listdir("/proc/self/fd"):
        with suppress(OSError):  # the descriptor of the listing itself
            if int(name) >= STANDARD_STREAMS and _leads_to_a_display(int(name)):
                poll.register(int(name), select.POLLRDHUP)
    return any(event & (select.POLLHUP | select.POLLRDHUP | select.POLLERR) for _, event in poll.poll(0))


def _leads_to_a_display(descriptor: int) -> bool:
    """Whether a descriptor is a socket to an X or Wayland server; other sockets may end without harm to the window."""
    if not stat.S_ISSOCK(os.fstat(descriptor).st_mode):
        return False
    end = socket.socket(fileno=descriptor)
    try:
        peer = end.getpeername()
    finally:
        end.detach()
    if isinstance(peer, tuple):
        return peer[1] in X_PORTS
    name = os.fsdecode(peer)
    return ".X11-unix/" in name or "wayland" in name


def _library(name: str | None) -> ctypes.CDLL | None:
    if not sys.platform.startswith("linux"):
        return None
    try:
        return ctypes.CDLL(name)
    except OSError:
        return None
