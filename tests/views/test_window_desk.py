"""The window: sliders, picking, following, stepping back; without a display, and once with a real display."""

import math

import numpy as np
import pytest
import yaml
from test_window import CORNER, WINDOW, Session, display

import mpp_taichi as mpp
from mpp_taichi.scene.spec import CameraSpec, ViewSpec
from mpp_taichi.views import pace
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.controls import MANY_STEPS, Controls
from mpp_taichi.views.following import CENTER, Follower
from mpp_taichi.views.pace import MOST_FRAMES, Pace
from mpp_taichi.views.picking import discs, pick, ring
from mpp_taichi.views.slider_panel import Knob, SliderPanel

__all__ = ["display"]  # a fixture
SIZE = (640, 360)
VIEW = ViewSpec(camera=CameraSpec(position=(0, 0, 8), look_at=(0, 0, 0), up=(0, 1, 0)))
PIXEL = 16.0 * math.tan(math.radians(22.5)) / 360.0  # length at the depth of 8


def frame(position, radius=0.3, **more):
    """Particles at places."""
    count = len(position)
    return Frame(position=np.array(position, float), radius=np.full(count, radius), color=np.ones((count, 3)), **more)


def camera_of(seen):
    """The camera of the tests, 8 above the plane."""
    return Camera(VIEW.camera, seen, aspect=SIZE[0] / SIZE[1])


def clicked(*moments):
    """Let the mouse be at (x, y) with these buttons held, one moment after the other; where the user has clicked."""
    controls, camera = Controls(), camera_of(frame([[0, 0, 0]]))
    for x, y, *held in moments:
        controls.move((x, y), set(held), camera=camera, seconds=0.02, aspect=SIZE[0] / SIZE[1])
    return controls.take_click()


# --- sliders ----------------------------------------------------------------------------------------------------------------


class Hand:
    """A stand-in for GGUI's panel, in f32 as it is, that moves sliders by their names."""

    def __init__(self, **places):
        self.places, self.seen = places, {}

    def slider_float(self, text, old_value, minimum, maximum):
        label, _, name = text.partition("###")
        assert minimum - 1e-6 <= old_value <= maximum + 1e-6
        self.seen[name] = label
        return float(np.float32(self.places.get(name, old_value)))


def test_an_untouched_slider_changes_no_digit_of_its_value():
    for value in (0.1, 1 / 3, 2.9584e-4, 1e7, 0.0):
        for logarithmic in (False, True)[: 1 + (value > 0)]:
            knob = Knob("k", "k", 0.5 * value, 2.0 * value or 1.0, logarithmic, lambda value=value: value)
            assert SliderPanel([knob]).draw(Hand()) == {}


def test_a_slider_moves_along_its_scale_and_stays_in_its_range():
    linear = Knob("linear", "G", 0.0, 6e-4, False, lambda: 2.9584e-4)
    logarithmic = Knob("log", "drag", 0.01, 100.0, True, lambda: 1.0)
    panel, hand = SliderPanel([linear, logarithmic]), Hand(linear=4.5, log=-1.0)
    assert panel.draw(hand) == {"linear": 4.5e-4, "log": 0.1}
    assert hand.seen == {"linear": "G = 0.0002958  [1e-04]", "log": "drag = 1  [log10]"}
    assert SliderPanel([logarithmic]).draw(Hand(log=2.000001)) == {"log": 100.0}


def test_the_mouse_on_the_sliders_does_not_turn_the_scene():
    for height, turns in ((0.9, False), (0.1, True)):
        controls, camera = Controls(), camera_of(frame([[0, 0, 0]]))
        controls.occupied = [(0.0, 0.0, 0.5, 0.5)]  # from the upper left corner
        before = camera.backward.copy()
        for x in (0.2, 0.3, 0.9):
            controls.move((x, height), {"LMB"}, camera=camera, seconds=0.02, aspect=1.0)
        assert (not np.array_equal(camera.backward, before)) == turns and controls.take_click() is None


# --- picking and following --------------------------------------------------------------------------------------------------


def test_a_click_is_down_and_up_at_one_place():
    there = (0.5, 0.5)
    assert clicked(there, (0.5, 0.5, "LMB"), (0.501, 0.5, "LMB"), there) == (0.5, 0.5)
    assert clicked(there, (0.5, 0.5, "LMB"), (0.6, 0.5, "LMB"), (0.5, 0.5, "LMB"), there) is None
    assert clicked(there, (0.5, 0.5, "LMB", "Shift"), there) is None
    assert clicked(there, (0.5, 0.5, "RMB"), there) is None


@pytest.mark.parametrize("orthographic", [False, True])
def test_what_is_under_the_cursor_is_picked(orthographic):
    """By geometry alone: at depth 5 a pixel is five eighths as long as at depth 8 or, orthographic, as long."""
    seen = frame([[3.0, 0, 0], [3.0, 0, 3.0], [0, 0, 9], [-1.0, -2.0, 0], [np.nan, 0, 0]])
    camera = camera_of(seen)
    if orthographic:
        camera.turn_projection()
    drawn = discs(seen, camera, VIEW, SIZE)
    near = PIXEL if orthographic else PIXEL * 5.0 / 8.0
    np.testing.assert_allclose(drawn.middle[:2], [[320 + 3 / PIXEL, 180], [320 + 3 / near, 180]], rtol=1e-12)
    np.testing.assert_allclose(drawn.radius[:2], [0.3 / PIXEL, 0.3 / near], rtol=1e-12)
    assert np.isnan(drawn.middle[2]).all(), "behind the camera"

    def at(index, right=0.0):
        return pick(drawn, ((drawn.middle[index, 0] + right) / SIZE[0], drawn.middle[index, 1] / SIZE[1]), SIZE)

    assert at(0) == (1 if orthographic else 0) and at(1) == 1, "the nearer one of two behind each other"
    assert at(3) == 3 and at(3, 0.3 / PIXEL + 5) == 3 and at(3, 0.3 / PIXEL + 7) is None
    middle = ring(drawn, 3, SIZE)[::2].mean(axis=0) * SIZE
    np.testing.assert_allclose(middle, drawn.middle[3], rtol=1e-12)


def test_the_camera_goes_along_with_what_it_follows():
    follower, first = Follower(), frame([[1, 0, 0], [0, 2, 0]], center=(0.5, 1.0, 0.0))
    camera = camera_of(first)
    follower.update(camera, first)
    assert camera.target.tolist() == [0, 0, 0]
    assert follower.next(1) == "follows particle 1"
    follower.update(camera, first)
    assert camera.target.tolist() == [0, 2, 0], "aimed at"
    camera.pan(0.0, 0.5)
    aside = camera.target.copy()
    follower.update(camera, frame([[1, 0, 0], [0, 5, 1]]))
    assert camera.target.tolist() == (aside + [0, 3, 1]).tolist(), "then kept where it is in the picture"
    assert follower.next(1) == f"follows the {CENTER}" and follower.next(1) == "follows nothing"
    assert follower.next(None) == f"follows the {CENTER}"
    follower.update(camera, first)
    assert camera.target.tolist() == [0.5, 1, 0]


def test_pace_and_the_way_back_are_asked_for_by_arrows():
    controls, steps = Controls(), Pace(3)
    for key, shift in (("Up", False), ("Left", True), ("Left", False)):
        controls.press(key, shift=shift, camera=None, frame=None, aspect=1.0)
    assert controls.take_steps_back() == MANY_STEPS + 1 and not controls.running and controls.take_steps_back() == 0
    steps.change(controls.take_faster())
    assert steps.take() == 6 and steps.text == " x2"
    steps.took(1.0)
    assert [steps.take() for _ in range(3)] == [3, 3, 3], "halved where steps are slow"
    steps.change(-4)
    assert [steps.take() for _ in range(16)].count(1) == 6 and steps.text == " x1/8", "3/8 steps a frame"


def test_a_run_keeps_pace_with_the_clock_and_its_speed_is_told(monkeypatch):
    """At 3 steps in a 60th of a second, in frames of any length, 180 steps are taken in a second."""
    for frames in (7, 20, 60):
        paced = Pace(3)
        assert sum(paced.take(1.0 / frames) for _ in range(frames)) in (179, 180), "but for a rounding of the last step"
    slow = Pace(0.05)
    assert 2 <= sum(slow.take(1.0 / 60.0) for _ in range(60)) <= 3, "a scene of 3 steps in a second"
    assert Pace(3).take(10.0) == 3 * MOST_FRAMES, "a long wait is not made up for"
    now = [0.0]
    monkeypatch.setattr(pace.time, "perf_counter", lambda: now[0])
    for taken, expected in ((180, "1 s = 12.0 h, 180 steps/s"), (60, "1 s = 4.0 h of 12.0 h, 60 steps/s")):
        rate = pace.Rate()
        for _ in range(taken):
            now[0] += 1.0 / taken
            rate.count(1, 1.0 / 360.0)
        assert rate.text(Pace(3), {"time": "day"}) == expected
    assert rate.text(Pace(3), None) == "1 s = 0.167 of 0.500, 60 steps/s"


# --- a real window ------------------------------------------------------------------------------------------------------------

SCENE = """\
title: Laboratory
particles:
  - body: {name: stone, mass: 2, position: [3, 1.5, 0], radius: 0.3, color: [0.1, 0.9, 0.2]}
  - body: {name: pebble, mass: 1, position: [3, -1.5, 0], radius: 0.2, color: [0.1, 0.2, 0.9], free: false}
forces: [{uniform_gravity: {acceleration: [0, 0, 0]}}]
integrator: {leapfrog: {dt: 0.25}}
run: {duration: 100}
view: {camera: {position: [0, 0, 8], look_at: [0, 0, 0], up: [0, 1, 0]}}
sliders: [{set: 'forces.uniform_gravity.acceleration[1]', from: -2, to: 0, label: g}]
"""
PROGRAM = """
from mpp_taichi import Simulation
from mpp_taichi.cli._window_desk import SessionDesk
from mpp_taichi.cli._interactive import _Steered
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._signals import Interruption
from mpp_taichi.views.window import Window


class Told(_Steered):
    last = ""

    @property
    def finished(self):
        stone = self.simulation.snapshot().position[0].tolist()
        now = f"{self.simulation.step_count} {self.simulation.spec.forces[0].parameters['acceleration'][1]!r} {stone}"
        if now != self.last:
            print(now, flush=True)
        self.last = now
        return False


with Interruption() as interruption, Simulation("scene.yaml", backend="cpu", precision="f64") as simulation:
    goal = Goal(100.0, None, True)
    desk = SessionDesk(simulation, goal, [])
    told = Told(simulation, simulation.scene, goal, [], interruption, history=desk.history)
    window = Window(simulation.scene.view, (640, 360), title="Laboratory", desk=desk.desk())
    window.run(told, steps_per_frame=1, paused=True)
"""
ORANGE, GRAB = (230, 158, 0), (61, 133, 224)
SLIDER = (16, 288, 169)  # left and right end, and row, of the first slider in the window


def pixels(picture, color, left=0):
    """Column and row of the middle of what has a colour, from a column on, and how many pixels those are."""
    rows, columns = (np.abs(picture[:, left:] - np.array(color)).max(axis=2) < 40).nonzero()
    return (left + float(columns.mean()), float(rows.mean()), len(rows)) if len(rows) else (0.0, 0.0, 0)


def stone(picture):
    """Column and row of the stone, which alone is green where nothing is written."""
    part = picture[:, 440:]
    rows, columns = (part[:, :, 1] > 2 * np.maximum(part[:, :, 0], part[:, :, 2]) + 20).nonzero()
    return 440 + float(columns.mean()), float(rows.mean())


@pytest.mark.sampled(3)
def test_a_slider_picking_the_way_back_and_the_log_in_a_real_window(display, tmp_path):
    """The geometry of the camera says where everything must be; a lit sphere's middle is known to a pixel or two."""
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    session = Session(display, tmp_path, program=PROGRAM, title="Laboratory")
    try:
        session.wait_for(lambda: session.said()[-1:] == ["0 0.0 [3.0, 1.5, 0.0]"])
        first = session.picture()
        np.testing.assert_allclose(stone(first), (320 + 3 / PIXEL, 180 - 1.5 / PIXEL), atol=2.0)
        left, right, row = SLIDER
        x, y, count = pixels(first[:, :300], GRAB)
        assert count > 50 and x > right - 20 and abs(y - row) < 5, "the slider stands at its upper end"

        session.tool("mousemove", CORNER[0] + round(x), CORNER[1] + row)
        session.press()
        session.tool("mousedown", 1)
        for part in range(1, 6):
            session.press()
            session.tool("mousemove", CORNER[0] + round(x + part * ((left + right) / 2 - x) / 5), CORNER[1] + row)
        session.press()
        session.tool("mouseup", 1)
        session.press()
        gravity = float(session.said()[-1].split()[1])
        assert -1.2 < gravity < -0.8 and session.said()[-1].startswith("0 "), "half way, and no step was done"
        np.testing.assert_allclose(stone(session.picture()), stone(first), atol=0.5)  # nor was the camera turned

        for number in range(1, 5):
            session.press("Right")
            session.wait_for(lambda number=number: session.said()[-1].startswith(f"{number} "))
        told = {line.split()[0]: line for line in session.said()[1:]}
        height = float(told["4"].split()[3].rstrip(","))
        assert height == pytest.approx(1.5 + 0.5 * gravity, abs=1e-12), "½ g t² at t = 1, with the gravity of the slider"
        fallen = session.wait_for(lambda: (p := stone(session.picture()))[1] > 180 - 1.4 / PIXEL and p)
        np.testing.assert_allclose(fallen, (320 + 3 / PIXEL, 180 - height / PIXEL), atol=2.0)

        session.tool("mousemove", CORNER[0] + round(fallen[0]) + 6, CORNER[1] + round(fallen[1]))
        session.press()
        session.tool("mousedown", 1)
        session.press()
        session.tool("mouseup", 1)
        marked = session.wait_for(lambda: pixels(p := session.picture(), ORANGE, left=440)[2] > 50 and [p])[0]
        ring_middle = pixels(marked, ORANGE, left=440)[:2]
        np.testing.assert_allclose(ring_middle, (320 + 3 / PIXEL, 180 - height / PIXEL), atol=1.0)
        assert (marked[260:, 10:330].min(axis=2) > 180).sum() > 300, "its name, place, velocity and mass are written"

        session.press("Left")
        session.press("Left")
        session.wait_for(lambda: session.said()[-1].startswith("2 "))
        assert session.said()[-1] == told["2"], "bit for bit where it was"
        session.press("Tab")
        session.wait_for(lambda: abs(pixels(session.picture(), ORANGE, left=300)[0] - WINDOW[0] / 2) < 2)
        for key in ("s", "l"):
            session.press(key)
        session.wait_for(lambda: list(tmp_path.glob("out/scene_log_*.yaml")) and list(tmp_path.glob("out/scene_0000.npz")))
        session.press("Escape")
        assert session.end() == 0 and session.complaints() == ""
    finally:
        session.close()
    log = tmp_path / "out" / "scene_log_0000.yaml"
    assert yaml.safe_load(log.read_text(encoding="utf-8"))["timeline"][0]["at"] == 0.0
    state = mpp.Snapshot.load(tmp_path / "out" / "scene_0000.npz")
    with mpp.Simulation(log, backend="cpu", precision="f64") as again:
        assert np.array_equal(again.run().snapshot().position, state.position) and again.step_count == state.step == 2
