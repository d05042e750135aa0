"""Keys and drags of a real window, in sequence in one run, with their effects on the run, the camera or the picture.

Where the camera is, is what K prints. The other keys of the help are driven in test_window.py, test_window_desk.py and
test_window_scenes.py.
"""

import re
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from test_window import CORNER, WINDOW, Session, display
from test_window_desk import GRAB, PIXEL, pixels

from mpp_taichi.views.controls import HELP, MANY_STEPS, ZOOM_PER_HEIGHT
from mpp_taichi.views.pace import MOST_FRAMES

__all__ = ["display"]  # a fixture
SCENE = """\
title: Keys
particles:
  - body: {name: near, mass: 1, position: [0.6, -0.5, 3], velocity: [0.1, 0, 0], radius: 0.25, color: [0.9, 0.1, 0.1]}
  - body: {name: far, mass: 3, position: [2.5, 0.8, 0], velocity: [0.1, 0, 0], radius: 0.25, color: [0.1, 0.1, 0.9]}
forces: [{uniform_gravity: {acceleration: [0, 0, 0]}}]
integrator: {leapfrog: {dt: 0.01}}
run: {duration: 1000}
view: {camera: {position: [0, 0, 8], look_at: [0, 0, 0], up: [0, 1, 0]}}
sliders: [{set: 'forces.uniform_gravity.acceleration[1]', from: -2, to: 0, label: g, keys: [b, m]}]
"""
PROGRAM = """
from mpp_taichi import Simulation
from mpp_taichi.cli._window_desk import SessionDesk
from mpp_taichi.cli._interactive import _Steered
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._signals import Interruption
from mpp_taichi.views.window import Window


class Told(_Steered):
    def advance(self, steps):
        super().advance(steps)
        print(f"{self.simulation.step_count} by {steps}", flush=True)

    def frame(self):
        if self.back and self.simulation.step_count < self.back:
            print(f"{self.simulation.step_count} again", flush=True)
        self.back = self.simulation.step_count
        return super().frame()

    back = 0


with Interruption() as interruption, Simulation("scene.yaml", backend="cpu", precision="f64") as simulation:
    goal = Goal(1000.0, None, True)
    desk = SessionDesk(simulation, goal, [])
    told = Told(simulation, simulation.scene, goal, [], interruption, history=desk.history)
    window = Window(simulation.scene.view, (640, 360), title="Keys", desk=desk.desk())
    window.run(told, steps_per_frame=4, paused=True)
"""
PLACES = np.array([[0.6, -0.5, 3.0], [2.5, 0.8, 0.0]])
CENTER = np.array([1, 3]) @ PLACES / 4.0  # of mass
DRAGGED = 72  # pixels


class Hand(Session):
    """A session that is asked where its camera is."""

    def camera(self):
        """What K prints now: position, look_at, up, and whether it is orthographic."""
        before = self.complaints().count("field_of_view: 45\n")
        self.press("k", seconds=0.05)
        self.wait_for(lambda: self.complaints().count("field_of_view: 45\n") > before)
        said = self.complaints()
        found = yaml.safe_load(said[said.rindex("view:\n") :])["view"]["camera"]
        places = (np.array(found[key], float) for key in ("position", "look_at", "up"))
        return *places, found.get("projection") == "orthographic"

    def drag_with(self, *keys, right=0, up=0):
        """Drag with the left button while keys are held."""
        for key in keys:
            self.tool("keydown", key)
        time.sleep(0.1)
        self.drag(1, right, -up)
        for key in keys:
            self.tool("keyup", key)
        time.sleep(0.1)

    def steps(self):
        """Step counts after each advance, and by how many steps each went."""
        words = [line.split() for line in self.said() if re.match(r"\d+ (by|again)", line)]
        return [int(each[0]) for each in words], [int(each[2]) if each[1] == "by" else 0 for each in words]


def count(picture, channel):
    """Pixels of a sphere that is bright in one colour alone, where nothing is written."""
    part = picture[:, 330:]
    others = np.delete(part, channel, axis=2).max(axis=2)
    return int((part[:, :, channel] > 2 * others + 20).sum())


def seen(position, look_at, up, points):
    """Right and up of points in a picture, in halves of its height, by a field of view of 45°."""
    backward = (position - look_at) / np.linalg.norm(position - look_at)
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    depth = np.linalg.norm(position - look_at) - (points - look_at) @ backward
    return np.stack([(points - look_at) @ right, (points - look_at) @ np.cross(backward, right)]) / depth / np.tan(np.pi / 8)


@pytest.mark.timeout(180)
@pytest.mark.sampled(3)
def test_every_other_key_does_what_the_help_says(display, tmp_path):
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    hand = Hand(display, tmp_path, program=PROGRAM, title="Keys")
    try:
        camera_keys(hand)
        drags(hand)
        pace_and_the_way_back(hand)
        following_the_center(hand)
        steering(hand)
        assert pixels(hand.picture()[:, :300], GRAB)[2] > 50, "a slider is there"
        hand.press("v")
        hand.wait_for(lambda: pixels(hand.picture()[:, :300], GRAB)[2] == 0)
        hand.press("v")
        hand.wait_for(lambda: pixels(hand.picture()[:, :300], GRAB)[2] > 50)
        hand.press("q")
        assert hand.end() == 0
    finally:
        hand.close()


def camera_keys(hand):
    """X, Y, Z, G, O, I, F, R."""
    for key, direction, up in (("x", [1, 0, 0], [0, 0, 1]), ("y", [0, -1, 0], [0, 0, 1]), ("z", [0, 0, 1], [0, 1, 0])):
        hand.press(key)
        position, look_at, above, _ = hand.camera()
        np.testing.assert_allclose(position - look_at, 8.0 * np.array(direction), atol=1e-5)
        np.testing.assert_allclose(above, up, atol=1e-9)
    picture = hand.picture()
    assert 1.9 < count(picture, 0) / count(picture, 2) < 3.3, "at 5/8 of the distance a sphere has 2.6 times the area"
    hand.press("g")
    assert hand.camera()[3]
    picture = hand.picture()
    assert 0.8 < count(picture, 0) / count(picture, 2) < 1.25, "without perspective it has the same"
    hand.press("g")
    assert not hand.camera()[3]
    for key, nearer in (("o", False), ("i", True)):
        before = np.linalg.norm(hand.camera()[0])
        hand.press(key, seconds=0.5)
        after = np.linalg.norm(hand.camera()[0])
        assert after < 0.8 * before if nearer else after > 1.25 * before
    hand.press("o", seconds=1.0)
    hand.press("f")
    position, look_at, above, _ = hand.camera()
    there = np.abs(seen(position, look_at, above, PLACES))
    assert (there[0] < WINDOW[0] / WINDOW[1]).all() and (there[1] < 1.0).all(), "everything is in the picture"
    np.testing.assert_allclose(look_at, CENTER, atol=1e-5)
    reach = np.linalg.norm(PLACES[0] - CENTER) / np.linalg.norm(position - look_at) / np.tan(np.pi / 8)
    assert 0.6 < reach < 1.0, "whichever way it is turned, and fills it"
    hand.press("r")
    position, look_at, above, _ = hand.camera()
    assert (*position, *look_at, *above) == (0, 0, 8, 0, 0, 0, 0, 1, 0)
    hand.press("alt", "Right", seconds=0.3)
    hand.press("shift", "Up", seconds=0.3)
    position, look_at, above, _ = hand.camera()
    assert (position[:2] > 0.1).all() and (position - look_at)[2] == 8, "aside and up, with the same line of sight"
    hand.press("r")
    hand.press("ctrl", "shift", "Left", seconds=0.3)
    position, look_at, above, _ = hand.camera()
    assert above[0] < -0.05 and (*position, *look_at) == (0, 0, 8, 0, 0, 0), "rolled"
    hand.press("r")
    hand.tool("mousemove", CORNER[0] + WINDOW[0] // 2 + DRAGGED, CORNER[1] + WINDOW[1] // 2)
    for action in ("keydown ctrl", "mousedown 1", "mouseup 1", "keyup ctrl"):
        hand.tool(*action.split())
        time.sleep(0.1)
    position, look_at, above, _ = hand.camera()
    aside = DRAGGED * PIXEL / np.hypot(8.0, DRAGGED * PIXEL)  # the sine of the angle
    np.testing.assert_allclose((look_at - position)[0] / np.linalg.norm(look_at - position), aside, atol=2.5 * PIXEL / 8.0)
    np.testing.assert_allclose(position, [0, 0, 8], atol=1e-4)
    hand.press("r")
    assert not hand.steps()[0], "no arrow with these keys is a step of the run"


def drags(hand):
    """Left drag, and with Shift and Ctrl; R between them. A drag is right to a pixel or two."""
    hand.drag_with(right=DRAGGED)
    position, look_at, _, _ = hand.camera()
    assert position[0] < -1.0 and abs(np.linalg.norm(position) - 8.0) < 1e-4 and not look_at.any(), "turned about the middle"
    hand.press("r")
    hand.drag_with("shift", right=DRAGGED, up=DRAGGED // 2)
    position, look_at, _, _ = hand.camera()
    np.testing.assert_allclose(look_at, [-DRAGGED * PIXEL, -DRAGGED // 2 * PIXEL, 0.0], atol=2.5 * PIXEL)
    np.testing.assert_allclose(position - look_at, [0, 0, 8], atol=1e-4)
    hand.press("r")
    hand.drag_with("ctrl", up=DRAGGED)
    position, look_at, _, _ = hand.camera()
    nearer = ZOOM_PER_HEIGHT ** (DRAGGED / WINDOW[1])
    np.testing.assert_allclose(position, [0, 0, 8 / nearer], rtol=ZOOM_PER_HEIGHT ** (2.5 / WINDOW[1]) - 1.0, atol=1e-9)
    hand.press("r")


def pace_and_the_way_back(hand):
    """Up, down, space, left arrow with Shift. Frames have the steps of their time, up to a limit."""
    hand.press("Up")
    hand.press("space")
    hand.wait_for(lambda: max(hand.steps()[1], default=0) >= 8)
    hand.press("space")
    for _ in range(3):
        hand.press("Down")
    quick = len(hand.steps()[1])
    hand.press("space")
    hand.wait_for(lambda: len(hand.steps()[1]) > quick + MANY_STEPS + 5)
    hand.press("space")
    counts, by = hand.steps()
    assert 8 <= max(by[:quick]) <= 8 * MOST_FRAMES and max(by[quick:]) <= MOST_FRAMES
    hand.press("shift", "Left")
    hand.wait_for(lambda: hand.said()[-1].endswith("again"))
    assert hand.steps()[0][-1] == counts[-1 - MANY_STEPS]
    hand.press("Up")
    hand.press("Up")


def following_the_center(hand):
    """Tab without a particle picked: the center of mass, then nothing. It moves at 0.1."""
    start = hand.steps()[0][-1]
    hand.press("Tab")
    np.testing.assert_allclose(hand.camera()[1], CENTER + [0.1 * 0.01 * start, 0, 0], atol=1e-4)
    hand.press("shift", "Right")
    hand.wait_for(lambda: hand.steps()[0][-1] == start + MANY_STEPS)
    there = hand.camera()[1]
    np.testing.assert_allclose(there, CENTER + [0.1 * 0.01 * (start + MANY_STEPS), 0, 0], atol=1e-4)
    hand.press("Tab")
    hand.press("Right")
    hand.wait_for(lambda: hand.steps()[0][-1] == start + MANY_STEPS + 1)
    np.testing.assert_allclose(hand.camera()[1], there, atol=1e-9)
    hand.press("r")


def steering(hand):
    """A letter that is held moves its slider to an end, and the log has the move."""
    before = hand.steps()[0][-1]
    hand.tool("keydown", "b")
    time.sleep(0.3)
    hand.press("Right")
    hand.press("l")
    hand.tool("keyup", "b")
    (path,) = hand.wait_for(lambda: list(hand.folder.glob("out/scene_log_*.yaml")))
    (move,) = yaml.safe_load(path.read_text(encoding="utf-8"))["timeline"]
    assert move == {"at": pytest.approx(0.01 * before), "set": {"forces.uniform_gravity.acceleration[1]": -2.0}}


def test_the_page_of_the_window_tells_every_key_of_the_help():
    page = (Path(__file__).parents[2] / "docs" / "window.md").read_text(encoding="utf-8")
    keys = [line.split("|")[1] for line in page.splitlines() if line.startswith("| ")]
    told = set(re.findall(r"\w+", " ".join(keys).lower())) | ({"h"} if "H shows the keys" in page else set())
    for named, _ in HELP:
        assert set(re.findall(r"\w+", named.lower())) <= told, f"docs/window.md lacks {named}"
