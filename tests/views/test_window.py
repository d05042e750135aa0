"""The window on a virtual display: keys and mouse act as the help describes, and every way to close it ends cleanly."""

import ctypes
import ctypes.util
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from pictures import frame_of
from PIL import Image

from mpp_taichi.device import backends
from mpp_taichi.scene.spec import CameraSpec, ViewSpec
from mpp_taichi.scene.view_spec import SkySpec
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.overlay import overlay_layer
from mpp_taichi.views.renderer import Renderer
from mpp_taichi.views.waiting import waiting_picture
from mpp_taichi.views.x_full_screen import ClientMessage

ROOT = Path(__file__).parents[2]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}
TOOLS = ("Xvfb", "xdotool", "import")
SCREEN = (800, 600)
WINDOW = (640, 360)
CORNER = (100, 100)  # where GGUI puts its window

PROGRAM = """
import sys
import numpy as np
from mpp_taichi.device import backends
from mpp_taichi.scene.spec import CameraSpec, ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.window import Window


class Planets:
    step = 0
    finished = False

    def advance(self, steps):
        if self.step + steps > int(sys.argv[1]):
            raise ArithmeticError("blew up")
        self.step += steps
        self.tell(f"at {self.step}")

    def restart(self):
        self.step = 0
        self.tell("restart")

    def frame(self):
        t = 0.05 * self.step
        places = [[0, 0, 0], [2 * np.cos(t), 2 * np.sin(t), 0], [1.2 * np.cos(2 * t), 1.2 * np.sin(2 * t), 0]]
        colors = np.array([[1, 0.8, 0.1], [0.2, 0.5, 1], [1, 0.3, 0.2]])
        return Frame(
            position=np.array(places), radius=np.array([0.4, 0.15, 0.2]), color=colors, between=np.array([[0, 1]]),
            spring_color=np.array([[0.5, 0.9, 0.5]]), time=t, title="Planets", extra="dE/E = 1e-9",
        )

    def tell(self, what):
        print(what, flush=True)


backends.start("cpu", "f64")
camera = CameraSpec(position=(0, 0, 8), look_at=(0, 0, 0), up=(0, 1, 0))
panels = None
if len(sys.argv) > 2:
    from mpp_taichi.plots import Curves, Samples
    from mpp_taichi.plots.sheet import Sheet
    from mpp_taichi.scene.spec import RecordSpec
    from mpp_taichi.views.window_panels import WindowPanels

    samples = Samples()
    samples.open(2)
    for t in np.linspace(0, 6, 50):
        samples.add(np.array([t, np.sin(t)]))
    plot = Curves("A sine", "time", "s", ("sine",), "m", samples, 0, (1,), span=(0.0, 8.0))
    np.save("expected.npy", Sheet([plot], (224, 360), 10).picture())
    panels = WindowPanels([plot], RecordSpec(), lambda: print("exported", flush=True) or "exported")
Window(ViewSpec(camera=camera), (640, 360), title="Planets", panels=panels).run(Planets(), paused=True)
print("end", flush=True)
"""


SKY = """panels = None
from mpp_taichi.scene.view_spec import SkySpec
sky = SkySpec(stars=500)
"""
COLORS = [[1, 0.8, 0.1], [0.2, 0.5, 1], [1, 0.3, 0.2]]


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """A display in memory on a number that is free."""
    missing = [tool for tool in TOOLS if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    reading, writing = os.pipe()
    size = f"{SCREEN[0]}x{SCREEN[1]}x24"
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", size, "-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(command, pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        number = pipe.readline().strip()
    if not number:
        server.wait()
        pytest.skip("Xvfb does not start")
    probe = "from mpp_taichi.views.ggui_probe import probe; print('problem:', probe(shown=True))"
    answer = subprocess.run(
        [sys.executable, "-c", probe], env=ENVIRONMENT | {"DISPLAY": f":{number}"}, capture_output=True, text=True
    )
    try:
        assert answer.returncode == 0, answer.stderr
        if problem := answer.stdout.rpartition("problem:")[2].strip():
            pytest.skip(f"no window here: {problem}")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


class Session:
    """A program with a window, and hands on its keyboard and mouse."""

    def __init__(
        self, display: str, folder: Path, limit: int = 10**9, *more: str, program: str = PROGRAM, title: str = "Planets"
    ) -> None:
        self.folder = folder
        self.environment = ENVIRONMENT | {"DISPLAY": display}
        self.log = open(folder / "log.txt", "w+", encoding="utf-8")
        self.errors = open(folder / "errors.txt", "w+", encoding="utf-8")
        self.process = subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(program), str(limit), *more],
            cwd=folder,
            env=self.environment,
            # A background job of a shell is started with interrupts ignored, and so would be its children.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            stdout=self.log,
            stderr=self.errors,
        )
        self.window = self.wait_for(lambda: self.tool("search", "--onlyvisible", "--name", title).split()[:1])[0]
        self.title = title
        self.wait_for(lambda: (seen := self.picture()).max() > 100 and not self.is_compiling(seen))

    def tool(self, *arguments: object) -> str:
        """Run xdotool."""
        command = ["xdotool", *map(str, arguments)]
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=20).stdout

    def wait_for(self, found, seconds: float = 20.0):
        """Ask again until there is an answer."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            if answer := found():
                return answer
            if self.process.poll() is not None:
                break
            time.sleep(0.05)
        raise AssertionError(f"nothing came of it (code {self.process.poll()}); {self.said()}\n{self.complaints()}")

    def said(self) -> list[str]:
        """The lines the program printed."""
        return (self.folder / "log.txt").read_text(encoding="utf-8").splitlines()

    def complaints(self) -> str:
        """What the program wrote to its standard error."""
        return (self.folder / "errors.txt").read_text(encoding="utf-8")

    def picture(self) -> np.ndarray:
        """What the window shows, shape (360, 640, 3)."""
        return self.whole()[CORNER[1] : CORNER[1] + WINDOW[1], CORNER[0] : CORNER[0] + WINDOW[0]]

    def whole(self) -> np.ndarray:
        """The picture of the whole screen."""
        path = self.folder / "screen.png"
        subprocess.run(["import", "-window", "root", str(path)], env=self.environment, check=True, timeout=20)
        return np.asarray(Image.open(path).convert("RGB")).astype(int)

    def is_compiling(self, seen: np.ndarray) -> bool:
        """Whether the window shows the picture that is there while a scene is being compiled."""
        return np.array_equal(seen, waiting_picture(self.title, WINDOW, ViewSpec().background))

    def scene(self) -> np.ndarray:
        """The part of the window that no panel covers."""
        return self.picture()[130:]

    def press(self, *keys: str, seconds: float = 0.15) -> None:
        """Press keys together, as long as a finger does."""
        for key in keys:
            self.tool("keydown", key)
            time.sleep(0.06)
        time.sleep(seconds)
        for key in reversed(keys):
            self.tool("keyup", key)
        time.sleep(0.1)

    def drag(self, button: int, right: int, down: int) -> None:
        """Drag over the window's lower half."""
        x, y = CORNER[0] + WINDOW[0] // 2, CORNER[1] + 250
        self.tool("mousemove", x, y)
        time.sleep(0.1)
        self.tool("mousedown", button)
        for part in range(1, 6):
            time.sleep(0.05)
            self.tool("mousemove", x + right * part // 5, y + down * part // 5)
        time.sleep(0.1)
        self.tool("mouseup", button)
        time.sleep(0.15)

    def end(self) -> int:
        """The exit code, once the program has ended by itself."""
        return self.process.wait(timeout=20)

    def close(self) -> None:
        """Leave nothing running."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.log.close()
        self.errors.close()


@pytest.fixture
def session(display: str, tmp_path: Path) -> Iterator[Session]:
    """A paused simulation in a window."""
    opened = Session(display, tmp_path)
    yield opened
    opened.close()


def changed(one: np.ndarray, other: np.ndarray) -> int:
    """How many pixels are clearly different."""
    return int((np.abs(one - other).max(axis=2) > 30).sum())


@pytest.mark.sampled(3)
def test_running_pausing_stepping_and_starting_again(session: Session) -> None:
    still = session.scene()
    assert still.max() > 150 and changed(still, session.scene()) == 0, "paused"
    session.press("space")
    session.wait_for(lambda: len(session.said()) > 10)
    session.press("space")
    paused, count = session.scene(), len(session.said())
    assert changed(still, paused) > 50, "the planets moved"
    time.sleep(0.3)
    assert len(session.said()) == count
    before = int(session.said()[-1].split()[1])
    session.press("Right")
    session.press("shift", "Right")
    session.wait_for(lambda: session.said()[-1] == f"at {before + 51}")
    session.press("BackSpace")
    session.wait_for(lambda: session.said()[-1] == "restart")
    session.wait_for(lambda: changed(still, session.scene()) < 20)
    session.press("Escape")
    assert session.end() == 0
    assert session.said()[-1] == "end" and session.complaints() == ""


@pytest.mark.sampled(3)
def test_camera_follows_mouse_and_keys(session: Session) -> None:
    first = session.scene()
    for button, right, down in ((1, 80, 40), (3, 60, -30)):
        session.drag(button, right, down)
        assert changed(first, session.scene()) > 100, f"button {button} turns or moves the scene"
        session.press("r")
        session.wait_for(lambda: changed(first, session.scene()) < 20)
    session.press("i", seconds=0.6)
    lit = session.scene().max(axis=2) > 60
    assert lit.sum() > 1.3 * (first.max(axis=2) > 60).sum(), "nearer is larger"
    session.press("f")
    session.press("y")
    assert changed(first, session.scene()) > 100
    session.press("k")
    printed = session.wait_for(session.complaints)
    assert yaml.safe_load(printed[printed.index("view:") :])["view"]["camera"]["up"] == [0, 0, 1]
    session.press("q")
    assert session.end() == 0


@pytest.mark.sampled(3)
def test_help_trails_and_picture(session: Session) -> None:
    plain = session.picture()
    session.press("h")
    helped = session.wait_for(
        lambda: changed(plain, picture) > 1000 and [picture] if (picture := session.picture()) is not None else None
    )[0]
    assert (helped[60:250, 300:600].min(axis=2) > 180).sum() > 500, "white letters"
    session.press("h")
    session.wait_for(lambda: changed(plain, session.picture()) < 20)
    session.press("c")
    saved = session.wait_for(lambda: list(session.folder.glob("out/screenshot_*.png")))
    picture = np.asarray(Image.open(saved[0])).astype(int)
    assert picture.shape == (WINDOW[1], WINDOW[0], 3)
    assert changed(picture[130:], plain[130:]) < 50, "the picture is what the window shows"
    for _ in range(3):
        session.press("Right")
    without = session.scene()
    session.press("t")
    session.wait_for(lambda: changed(without, session.scene()) > 5)
    session.press("Escape")
    assert session.end() == 0


@pytest.mark.sampled(3)
def test_panels_are_those_of_a_film_and_say_what_the_cursor_points_at(display: str, tmp_path: Path) -> None:
    session = Session(display, tmp_path, 10**9, "with panels")
    try:
        session.tool("mousemove", CORNER[0] + 200, CORNER[1] + 300)
        expected = np.load(tmp_path / "expected.npy").astype(int)
        session.wait_for(lambda: np.array_equal(session.picture()[:, 416:], expected))
        beside = session.picture()
        sun = np.argwhere((beside[130:, :416] > (150, 120, 0)).all(axis=2) & (beside[130:, :416, 2] < 100)).mean(axis=0)
        assert np.abs(sun - (50, 208)).max() < 6, "the scene's middle is in the middle of its part"
        session.tool("mousemove", CORNER[0] + 416 + 100, CORNER[1] + 150)
        session.wait_for(lambda: changed(session.picture()[:, 416:], expected) > 300)
        session.press("e")
        session.wait_for(lambda: "exported" in session.said())
        session.press("p")
        session.wait_for(lambda: changed(session.picture()[:, 416:], expected) > 5000)
        session.press("Escape")
        assert session.end() == 0 and session.complaints() == ""
    finally:
        session.close()


@pytest.mark.parametrize("look", ["film", "plain"])
@pytest.mark.sampled(3)
def test_names_and_scale_bar_stand_where_a_film_has_them(display: str, tmp_path: Path, look: str) -> None:
    """In the look of films the picture is that of a film, to the last bit, below the status of the window."""
    program = PROGRAM.replace("ViewSpec(camera=camera)", "ViewSpec(camera=camera, labels=True, scale_bar=True, sky=sky)")
    program = program.replace('title="Planets", extra', 'name=("Sonne", "Erde", "Überß"), title="Planets", extra')
    program = program.replace("panels=panels)", f"panels=panels, look={look!r})").replace("panels = None", SKY)
    session = Session(display, tmp_path, program=program)
    try:
        camera = CameraSpec(position=(0, 0, 8), look_at=(0, 0, 0), up=(0, 1, 0))
        places = [[0, 0, 0], [2, 0, 0], [1.2, 0, 0]]
        names = ("Sonne", "Erde", "Überß")
        frame = frame_of(
            places, [0.4, 0.15, 0.2], COLORS, name=names, between=np.array([[0, 1]]), spring_color=[[0.5, 0.9, 0.5]]
        )
        view = ViewSpec(camera=camera, labels=True, scale_bar=True, sky=SkySpec(stars=500))
        picture = session.picture()
        if look == "film":
            backends.start("cpu", "f32")
            np.testing.assert_array_equal(picture[130:], Renderer(view, WINDOW).draw(frame)[130:])
        else:
            seen = Camera(camera, frame, aspect=16 / 9)
            rows, columns, colors = overlay_layer(frame, view, seen, WINDOW, (0.0, 0.0), WINDOW)
            assert len(rows) > 300
            np.testing.assert_array_equal(picture[rows, columns], colors)
        session.press("d")
        session.wait_for(lambda: changed(picture[130:], session.scene()) > 20)
        session.press("d")
        session.wait_for(lambda: np.array_equal(picture[130:], session.scene()))
        session.press("i", seconds=0.6)
        assert changed(picture[130:], session.scene()) > 100, "names go along with their bodies"
        session.press("Escape")
        assert session.end() == 0 and session.complaints() == ""
    finally:
        session.close()


def click_close_button(display: str, window: int) -> None:
    """Send what a window manager sends when its close button is clicked."""
    library = ctypes.util.find_library("X11")
    if library is None:
        pytest.skip("libX11 is missing")
    x11 = ctypes.CDLL(library)
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XInternAtom.restype = ctypes.c_ulong
    x11.XInternAtom.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int]
    x11.XSendEvent.argtypes = [ctypes.c_void_p, ctypes.c_ulong, ctypes.c_int, ctypes.c_long, ctypes.c_void_p]
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    connection = x11.XOpenDisplay(display.encode())
    protocols, delete = (x11.XInternAtom(connection, name, 0) for name in (b"WM_PROTOCOLS", b"WM_DELETE_WINDOW"))
    message = ClientMessage(type=33, window=window, message_type=protocols, format=32)
    message.data[0] = delete
    x11.XSendEvent(connection, window, 0, 0, ctypes.byref(message))
    x11.XCloseDisplay(connection)


@pytest.mark.sampled(3)
def test_closing_the_window_ends_cleanly(session: Session, display: str) -> None:
    session.press("space")
    session.wait_for(lambda: len(session.said()) > 5)
    click_close_button(display, int(session.window))
    assert session.end() == 0
    assert session.said()[-1] == "end"


@pytest.mark.sampled(3)
def test_nothing_is_left_in_the_working_directory(session: Session) -> None:
    time.sleep(5.5)  # the time after which the panel library writes its file while a window is open
    session.press("h")
    session.tool("key", "--window", session.window, "q")
    assert session.end() == 0
    assert {path.name for path in session.folder.iterdir()} <= {"log.txt", "errors.txt", "screen.png"}  # the test's own


@pytest.mark.sampled(3)
def test_error_in_the_simulation_closes_the_window_and_is_seen(display: str, tmp_path: Path) -> None:
    session = Session(display, tmp_path, limit=20)
    try:
        session.press("space")
        assert session.end() == 1
        assert "blew up" in session.complaints()
    finally:
        session.close()


@pytest.mark.sampled(3)
def test_interrupt_ends_the_program(session: Session) -> None:
    session.process.send_signal(signal.SIGINT)
    assert session.end() in (1, 130, -signal.SIGINT)


@pytest.mark.sampled(3)
def test_no_display_is_said(tmp_path: Path) -> None:
    environment = {key: value for key, value in ENVIRONMENT.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(PROGRAM), "1"], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    if not sys.platform.startswith("linux"):
        pytest.skip("only Linux has programs without a display")
    assert done.returncode == 1 and "BackendError: cannot open a window: there is no display" in done.stderr


@pytest.mark.sampled(3)
def test_dead_display_is_said(tmp_path: Path) -> None:
    if not sys.platform.startswith("linux"):
        pytest.skip("only Linux has programs without a display")
    environment = ENVIRONMENT | {"DISPLAY": ":4711"}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(PROGRAM), "1"], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert (
        done.returncode == 1
        and "BackendError: cannot open a window: GGUI does not start (code 1): cannot initialize GLFW" in done.stderr
    )
