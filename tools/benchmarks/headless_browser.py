"""A headless Chromium that is driven through two pipes, by Chrome's DevTools protocol: no port, no driver, no package.

The protocol is one JSON object after the other, ended by a zero byte, on file descriptors 3 and 4 of the browser
(https://chromedevtools.github.io/devtools-protocol/, --remote-debugging-pipe).
"""

import base64
import fcntl
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome")
ANSWER_SECONDS = 60.0
FAREWELL_SECONDS = 5.0
# The pipes are put where the browser looks for them in a process of its own; here these numbers may be taken.
LAUNCHER = "import os, sys; os.dup2(int(sys.argv[1]), 3); os.dup2(int(sys.argv[2]), 4); os.execv(sys.argv[3], sys.argv[3:])"
BUTTONS = {"left": 1, "right": 2, "none": 0}


def find_browser() -> str | None:
    """The browser of this machine, or None."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def _closing(descriptors: Iterable[int]) -> Iterator[int]:
    for descriptor in descriptors:
        yield descriptor
        os.close(descriptor)


def _fields(stat: str) -> tuple[int, int, int, int]:
    """Parent, process group, and ticks in both modes, of a line of /proc/PID/stat (proc(5)); the name may hold anything."""
    found = stat.rpartition(")")[2].split()
    return int(found[1]), int(found[2]), int(found[11]), int(found[12])


class BrowserError(RuntimeError):
    """The browser gave no answer, or the page threw an error."""


class HeadlessBrowser:
    """One page of a browser without a display, of (width, height) points; a context manager."""

    def __init__(self, size: tuple[int, int] = (1280, 720), *, dark: bool = False) -> None:
        """Start it.

        Raises:
            BrowserError: there is none, or it does not start.
        """
        executable = find_browser()
        if executable is None:
            raise BrowserError(f"no browser here: none of {', '.join(NAMES)} is installed")
        self._profile = tempfile.mkdtemp(prefix="browser-")
        pipes = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in _closing((*os.pipe(), *os.pipe()))]
        commands, self._commands, self._answers, answers = pipes
        options = ["--headless", "--no-sandbox", "--hide-scrollbars", "--no-first-run", "--disable-extensions", "--mute-audio"]
        options += ["--remote-debugging-pipe", f"--user-data-dir={self._profile}", f"--window-size={size[0]},{size[1]}"]
        options += ["about:blank"]
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-E", "-c", LAUNCHER, str(commands), str(answers), executable, *options],
            pass_fds=(commands, answers),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(commands)
        os.close(answers)
        self._buffer = b""
        self._number = 0
        self._session: str | None = None
        try:
            target = self.ask("Target.createTarget", url="about:blank")["targetId"]
            self._session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            self.ask("Page.enable")
            self.ask("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False)
            scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
            self.ask("Emulation.setEmulatedMedia", features=[scheme])
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "HeadlessBrowser":
        """The browser itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """End it."""
        self.close()

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Give a command of the protocol and wait for its result.

        Raises:
            BrowserError: the browser refused it, ended, or gave no answer for a minute.
        """
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        try:
            os.write(self._commands, json.dumps(message).encode() + b"\0")
        except OSError as error:
            raise BrowserError(f"{method}: the browser has ended: {error}") from error
        deadline = time.monotonic() + ANSWER_SECONDS
        while True:
            answer = self._read(deadline, method)
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise BrowserError(f"{method}: {answer['error'].get('message')}")
                return dict(answer["result"])

    def _read(self, deadline: float, method: str) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._answers], [], [], max(0.0, deadline - time.monotonic()))
            part = os.read(self._answers, 1 << 16) if ready else b""
            if not part:
                raise BrowserError(f"{method}: the browser {'ended' if ready else 'gave no answer'}")
            self._buffer += part
        message, _, self._buffer = self._buffer.partition(b"\0")
        return dict(json.loads(message))

    def open(self, page: Path, fragment: str = "") -> None:
        """Load a file and wait until its player is there (`player` of mpp_taichi/recorders/page)."""
        self.ask("Page.navigate", url=page.resolve().as_uri() + fragment)
        self.wait_for("typeof player !== 'undefined' && player !== null || !document.getElementById('message').hidden")

    def wait_for(self, condition: str, seconds: float = 30.0) -> None:
        """Wait until an expression of the page is true.

        Raises:
            BrowserError: it does not become so in time.
        """
        deadline = time.monotonic() + seconds
        while not self.evaluate(f"document.readyState === 'complete' && ({condition})"):
            if time.monotonic() > deadline:
                raise BrowserError(f"the page did not come to {condition}")
            time.sleep(0.02)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression of the page, as plain data; a promise is waited for.

        Raises:
            BrowserError: it throws.
        """
        found = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            details = found["exceptionDetails"]
            raise BrowserError(details.get("exception", {}).get("description") or details["text"])
        return found["result"].get("value")

    def settle(self) -> None:
        """Wait until two more pictures have been shown: what was asked for has been drawn."""
        self.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")

    def press(self, key: str, code: str = "", *, shift: bool = False) -> None:
        """Press and release a key, by its name in the events of the page."""
        text = {"text": key} if len(key) == 1 else {}
        given = {"key": key, "code": code or key, "modifiers": 8 if shift else 0}
        self.ask("Input.dispatchKeyEvent", type="keyDown", **given, **text)
        self.ask("Input.dispatchKeyEvent", type="keyUp", **given)

    def mouse(self, kind: str, x: float, y: float, button: str = "none", **more: Any) -> None:
        """One event of the mouse: mousePressed, mouseMoved, mouseReleased or mouseWheel."""
        held = 0 if kind == "mouseReleased" else BUTTONS[button]
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=held, clickCount=1, **more)

    def drag(self, start: tuple[float, float], end: tuple[float, float], button: str = "left", **more: Any) -> None:
        """Press at one place and release at another."""
        self.mouse("mousePressed", *start, button, **more)
        self.mouse("mouseMoved", *((a + b) / 2 for a, b in zip(start, end, strict=True)), button, **more)
        self.mouse("mouseMoved", *end, button, **more)
        self.mouse("mouseReleased", *end, button, **more)

    def picture(self) -> bytes:
        """What is shown, as a PNG."""
        return base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"])

    def processor_seconds(self) -> float:
        """Processor time that all processes of the browser have used so far; Linux only."""
        ticks = 0
        for entry in Path("/proc").glob("[0-9]*/stat"):
            try:
                _, group, user, system = _fields(entry.read_text(encoding="utf-8", errors="replace"))
            except OSError:
                continue  # it ended in between
            ticks += user + system if group == self._process.pid else 0
        return ticks / os.sysconf("SC_CLK_TCK")

    def close(self) -> None:
        """End the browser and all that it started; harmless when called twice."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGTERM)
            try:
                self._process.wait(timeout=FAREWELL_SECONDS)
            except subprocess.TimeoutExpired:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()
        for descriptor in (self._commands, self._answers):
            try:
                os.close(descriptor)
            except OSError:
                continue
        self._commands = self._answers = -1
        shutil.rmtree(self._profile, ignore_errors=True)
