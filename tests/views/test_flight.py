"""The camera as an aircraft: it goes and turns about its own place, and a scene can hold every place and turn of it."""

import math

import numpy as np
import pytest
import yaml
from pictures import frame_of

from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import CameraSpec
from mpp_taichi.views import flight
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.controls import Controls
from mpp_taichi.views.film_look import seeing

FRAME = frame_of([[0, 0, 0], [1, 2, 0]], [0.1, 0.1], [[1, 1, 1], [1, 1, 1]])
SPEC = CameraSpec(position=(0, 0, 8), look_at=(0, 0, 0), up=(0, 1, 0))
ASPECT = 16 / 9
EPSILON = 1e-12  # some 5000 rounding errors of numbers of the order of 1


def camera(spec=SPEC):
    return Camera(spec, FRAME, aspect=ASPECT)


def flown(*held, seconds=1.0, of=None):
    """A camera while keys are held, in pictures of a 64th of a second."""
    made = of or camera()
    for _ in range(round(64 * seconds)):
        flight.fly(made, set(held), 1.0 / 64.0)
    return made


def test_a_picture_that_takes_long_does_not_let_the_camera_leap():
    made = camera()
    flight.fly(made, {"Alt", "Up"}, 30.0)
    np.testing.assert_allclose(made.position, [0, 0, 8 * (1 - flight.GOING * flight.LONGEST)], atol=EPSILON)


def test_arrows_fly_only_with_their_modifiers():
    before = camera()
    for held in (("Up",), ("Left",), ("Shift", "Left"), ("Shift",), ("Control",), ("Alt", "i")):
        after = flown(*held)
        assert (after.position == before.position).all() and (after.backward == before.backward).all()
        assert not any(flight.is_flight(key, set(held)) for key in held)
    assert flight.is_flight("Up", {"Shift"}) and flight.is_flight("Left", {"Alt"}) and not flight.is_flight("i", {"Alt"})


def test_the_camera_goes_ahead_aside_and_up_along_its_own_axes():
    height = 2.0 * 8.0 * math.tan(math.radians(22.5))
    for held, way in (
        (("Alt", "Up"), [0, 0, -4.0]),
        (("Alt", "Down"), [0, 0, 4.0]),
        (("Alt", "Right"), [0.5 * height, 0, 0]),
        (("Alt", "Left"), [-0.5 * height, 0, 0]),
        (("Shift", "Up"), [0, 0.5 * height, 0]),
        (("Shift", "Down"), [0, -0.5 * height, 0]),
    ):
        after = flown(*held)
        np.testing.assert_allclose(after.position - [0, 0, 8], way, atol=EPSILON)
        np.testing.assert_allclose(after.target, way, atol=EPSILON, err_msg="it looks the same way")


def test_the_camera_turns_about_its_own_place():
    half = math.sqrt(0.5)
    for held, ahead, up in (
        (("Control", "Right"), [half, 0, -half], [0, 1, 0]),
        (("Control", "Left"), [-half, 0, -half], [0, 1, 0]),
        (("Control", "Up"), [0, half, -half], [0, half, half]),
        (("Control", "Down"), [0, -half, -half], [0, half, -half]),
        (("Control", "Shift", "Right"), [0, 0, -1], [half, half, 0]),
        (("Control", "Shift", "Left"), [0, 0, -1], [-half, half, 0]),
    ):
        after = flown(*held)
        np.testing.assert_allclose(after.position, [0, 0, 8], atol=EPSILON)
        np.testing.assert_allclose(-after.backward, ahead, atol=EPSILON)
        np.testing.assert_allclose(after.up, up, atol=EPSILON)


def test_a_loop_and_a_full_roll_lead_back():
    for held in (("Control", "Up"), ("Control", "Right"), ("Control", "Shift", "Left")):
        made = camera()
        for _ in range(80):  # of 4.5°, with the pole among the directions
            flight.fly(made, set(held), 0.1)
            axes = np.stack([made.right, made.up, made.backward])
            np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)  # 1/cos 89° times the rounding errors
        np.testing.assert_allclose(made.up, [0, 1, 0], atol=1e-9)
        np.testing.assert_allclose(made.position, [0, 0, 8], atol=1e-9)
        np.testing.assert_allclose(made.target, [0, 0, 0], atol=1e-9)


def test_yaw_keeps_the_horizon_level_and_a_drag_turns_about_the_rolled_axis():
    made = flown("Control", "Up", seconds=0.5)
    flown("Control", "Right", of=made)
    assert abs(made.right[1]) < EPSILON, "the axis of the scene stays the axis of the turntable"
    flown("Control", "Shift", "Right", of=made)
    axis = made.axis.copy()
    made.rotate(0.2, 0.1)
    assert (made.axis == axis).all()


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_scene_holds_a_camera_that_has_flown(orthographic):
    made = flown("Control", "Shift", "Right", seconds=0.7)
    for held in (("Control", "Up"), ("Alt", "Left"), ("Control", "Right"), ("Shift", "Up"), ("Alt", "Up")):
        flown(*held, seconds=0.6, of=made)
    if orthographic:
        made.turn_projection()
    printed = yaml.safe_load(made.as_yaml())["view"]
    body = {"body": {"mass": 1, "position": [0, 0, 0]}}
    read = load_scene({"title": "K", "particles": [body], "integrator": {"leapfrog": {"dt": 1}}, "view": printed})
    again = camera(read.view.camera)
    for name in ("position", "target", "right", "up", "backward"):  # K prints six digits
        np.testing.assert_allclose(getattr(again, name), getattr(made, name), atol=2e-5, err_msg=name)
    assert again.orthographic is orthographic and abs(again.visible_height - made.visible_height) < 1e-4


@pytest.mark.sampled(2)
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("particle", [False, True])
def test_the_camera_turns_to_a_point(orthographic, particle):
    made = camera()
    if orthographic:
        made.turn_projection()
    place = np.array([1.5, -1.0, 2.0 if particle else 0.0])
    right, up, _ = made.view(place)
    flight.turn_to(made, right / made.visible_height, up / made.visible_height, place if particle else None)
    np.testing.assert_allclose(made.view(place)[:2], 0.0, atol=EPSILON, err_msg="in the middle")
    if not orthographic:
        np.testing.assert_allclose(made.position, [0, 0, 8], atol=EPSILON)
        np.testing.assert_allclose(made.target, place, atol=EPSILON, err_msg="and a drag turns about it")


def test_a_click_with_ctrl_turns_and_picks_nothing():
    controls, made = Controls(), camera()
    for held in (set(), {"LMB", "Control"}, {"Control"}):
        controls.move((0.7, 0.6), held, camera=made, seconds=0.02, aspect=ASPECT)
    assert controls.take_click() is None and controls.take_click(turns=True) == (0.7, 0.6)
    assert controls.take_click(turns=True) is None
    for held in (set(), {"LMB"}, set()):
        controls.move((0.7, 0.6), held, camera=made, seconds=0.02, aspect=ASPECT)
    assert controls.take_click(turns=True) is None and controls.take_click() == (0.7, 0.6)


def test_a_camera_without_perspective_zooms_in_a_window_of_another_shape():
    """The window sees a height larger by a factor while keys and mouse move the camera."""
    made = camera()
    made.turn_projection()
    height = made.height
    with seeing(made, 1.5):
        made.zoom(2.0)
        flight.go(made, forward=math.log(1.25))
    assert made.height == pytest.approx(height / 2.5, rel=1e-15, abs=0.0)
    with seeing(made, 1.1):
        pass
    assert made.height == pytest.approx(height / 2.5, rel=1e-15, abs=0.0) and made.field_of_view == 45.0
