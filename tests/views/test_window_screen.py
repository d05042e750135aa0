"""The window on a small screen: its place, its title, the picture while a scene is being compiled, and the mouse wheel."""

import os
import subprocess

import numpy as np
import pytest
import yaml
from PIL import Image
from test_window import display
from test_window_keys import Hand
from test_window_scenes import GREEN, RED, scene

from mpp_taichi.views.controls import ZOOM_PER_CLICK
from mpp_taichi.views.paper import GROUND, RIM
from mpp_taichi.views.waiting import waiting_picture
from mpp_taichi.views.window_boxes import BUTTON_WIDTH, BUTTONS
from mpp_taichi.views.window_layout import COLUMN, STRIP
from mpp_taichi.views.window_place import BAR, FRAME, PLACE, fitted

HELP_BUTTON = len(BUTTONS)
__all__ = ["display"]  # a fixture: it skips where no window can open
PROGRAM = """
import sys
import time
from pathlib import Path
from mpp_taichi.cli.main import main
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.views.glass import Glass

run, put = Simulation.run, Glass.put


def hold(name):
    print(name, flush=True)
    while not Path(name).exists():
        time.sleep(0.02)


def slow(self, *words, **more):
    Simulation.run = run
    hold("step")  # a large step takes seconds to compile
    return run(self, *words, **more)


def waits(self, picture):
    put(self, picture)
    if self.title not in told:
        told.add(self.title)
        self.show()
        hold(f"wait{len(told)}")


told = set()
Simulation.run, Glass.put = slow, waits
sys.exit(main(["run", "one.yaml", "--backend", "cpu"]))
"""


@pytest.fixture(scope="module")
def small(display):
    """A screen of 1280 × 800 pixels."""
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(command, pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        number = pipe.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("screen", [(1280, 800), (1366, 768), (1920, 1080), (1024, 600)])
@pytest.mark.parametrize("size", [(1280, 720), (640, 360)])
def test_a_window_is_on_the_screen_with_its_title(screen, size):
    (width, height), (left, top) = fitted(size, screen)
    assert left >= 0 and left + width <= screen[0]
    assert top >= FRAME[1] and top + height <= screen[1] - BAR
    assert width == min(size[0], screen[0]) and height == min(size[1], screen[1] - BAR - FRAME[1]), "no smaller than necessary"
    assert fitted(size, (4000, 3000)) == fitted(size, None) == (size, PLACE)


class Screen(Hand):
    """A window at a place of its own choice, whose program goes on when it may."""

    def click_button(self, number):
        """Click a button of the strip."""
        left, top, _, height = self.place()
        self.tool("mousemove", left + RIM + number * (BUTTON_WIDTH + 4) + 10, top + height - STRIP + 10)
        for action in ("mousemove_relative", "mousedown", "mouseup"):
            self.press()
            self.tool(action, *(("1", "0") if "move" in action else ("1",)))
        self.press()

    def is_compiling(self, seen):
        """The tests look for themselves."""
        return False

    def wait_at(self, name):
        """Wait until the program stands still."""
        self.wait_for(lambda: name in self.said())

    def go_on(self, name):
        """Let the program go on."""
        (self.folder / name).touch()

    def place(self):
        """Left, top, width and height on the screen."""
        found = dict(line.split("=") for line in self.tool("getwindowgeometry", "--shell", self.window).split())
        return tuple(int(found[key]) for key in ("X", "Y", "WIDTH", "HEIGHT"))

    def picture(self):
        """What the window shows."""
        path = self.folder / "screen.png"
        subprocess.run(["import", "-window", "root", str(path)], env=self.environment, check=True, timeout=20)
        screen = np.asarray(Image.open(path).convert("RGB")).astype(int)
        left, top, width, height = self.place()
        return screen[top : top + height, left : left + width]


@pytest.mark.timeout(120)
@pytest.mark.sampled(3)
def test_a_scene_is_announced_and_the_wheel_zooms_in_a_window_on_the_screen(small, tmp_path):
    en_dash = "Maxwell–Boltzmann ü"
    for name, content in {"one": scene("First", GREEN), "two": scene(en_dash, RED)}.items():
        content["view"]["background"] = [0.0, 0.1, 0.2]
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")
    session = Screen(small, tmp_path, program=PROGRAM, title="First")
    try:
        left, top, width, height = session.place()
        assert (width, height) == (1280, 720) and left == 0 and top + height <= 800
        assert session.complaints() == "compiling First …\n"
        waiting = waiting_picture("First", (width, height), (0.0, 0.1, 0.2))
        session.wait_at("wait1")
        np.testing.assert_array_equal(session.picture(), waiting)
        session.go_on("wait1")
        session.wait_at("step")
        first = session.picture()
        assert (first[:, :, 1] > 2 * first[:, :, 0] + 60).sum() > 500, "the first picture is there while the step is compiled"

        session.go_on("step")
        before = np.linalg.norm(session.camera()[0])
        session.tool("mousemove", left + 600, top + 300)
        for _ in range(3):
            session.tool("click", "4")
        nearer = np.linalg.norm(session.camera()[0])
        assert nearer == pytest.approx(before / ZOOM_PER_CLICK**3, rel=1e-5)
        session.tool("click", "5")
        assert np.linalg.norm(session.camera()[0]) == pytest.approx(nearer * ZOOM_PER_CLICK, rel=1e-5)
        session.tool("mousemove", 1279, 799)
        session.tool("click", "4")
        assert np.linalg.norm(session.camera()[0]) == pytest.approx(nearer * ZOOM_PER_CLICK, rel=1e-5), "not beside the window"

        session.click_button(0)  # pause
        plain = session.picture()
        session.click_button(HELP_BUTTON)
        session.wait_for(lambda: (session.picture()[:600, :COLUMN].min(axis=2) > 150).sum() > 1000)
        assert (session.picture()[660, 2:COLUMN] == GROUND).all(), "the boxes lie beside the picture"
        session.click_button(HELP_BUTTON)
        session.wait_for(lambda: (session.picture()[:600] == plain[:600]).all())
        before = np.linalg.norm(session.camera()[0])
        session.click_button(len(BUTTONS) + 2)  # minus
        assert np.linalg.norm(session.camera()[0]) == pytest.approx(1.25 * before, rel=1e-5)

        session.click_button(len(BUTTONS) + 1)  # film
        part = tmp_path / "out" / "one_0000.part.mp4"
        session.wait_for(part.exists)
        session.press()
        session.click_button(len(BUTTONS) + 1)
        session.wait_for((tmp_path / "out" / "one_0000.mp4").exists)
        assert not part.exists()

        for key in ("n", "Down", "Return"):
            session.press(key)
        session.wait_at("wait2")
        np.testing.assert_array_equal(session.picture(), waiting_picture(en_dash, (width, height), (0.0, 0.1, 0.2)))
        assert f"compiling {en_dash} …" in session.complaints()
        session.go_on("wait2")
        session.wait_for(lambda: session.tool("search", "--onlyvisible", "--name", f"^{en_dash}$").split() == [session.window])
        session.press("q")
        assert session.end() == 0
    finally:
        session.close()


def test_the_waiting_picture_has_letters_beyond_ascii():
    plain, dashed = (waiting_picture(title, (640, 360), (0.0, 0.0, 0.0)) for title in ("A-B", "A–B"))
    assert (plain != dashed).any() and dashed.max() > 200
