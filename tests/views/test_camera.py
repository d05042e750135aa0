"""The camera: it shows the whole scene, and keys and mouse move it as the help describes."""

import math

import numpy as np
import pytest
import yaml
from pictures import FRONT, crowd, frame_of

from mpp_taichi.scene.spec import CameraSpec
from mpp_taichi.snapshot import Snapshot, Springs
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.controls import Controls


@pytest.mark.sampled(2)
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("aspect", [16 / 9, 1.0, 0.5])
@pytest.mark.parametrize("scale", [1.0, 1.5e11, 1e-9])
def test_framing_shows_every_particle(projection: str, aspect: float, scale: float) -> None:
    random = np.random.default_rng(5)
    frame = frame_of((random.normal(size=(50, 3)) + (7.0, -3.0, 2.0)) * scale, random.uniform(0, 0.5, 50) * scale)
    camera = Camera(CameraSpec(projection=projection), frame, aspect=aspect)
    right, up, depth = camera.view(frame.position).T
    half = camera.height / 2 if projection == "orthographic" else depth * math.tan(math.radians(22.5))
    assert (depth > 0).all()
    assert ((np.abs(up) + frame.radius) / half).max() < 1.0
    assert ((np.abs(right) + frame.radius) / (half * aspect)).max() < 1.0
    assert max(((np.abs(up) + frame.radius) / half).max(), ((np.abs(right) + frame.radius) / (half * aspect)).max()) > 0.5


@pytest.mark.sampled(2)
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("aspect", [16 / 9, 1.0, 0.5])
@pytest.mark.parametrize("scale", [1.0, 1.5e11])
def test_a_motion_fills_the_picture_and_stays_in_it(projection: str, aspect: float, scale: float) -> None:
    random = np.random.default_rng(7)
    for _ in range(5):
        places = random.normal(size=(6, 3)) * random.uniform(0.1, 3.0, 3) + random.normal(size=3)
        motion = np.concatenate([places, random.uniform(0.0, 0.2, (6, 1))], axis=1) * scale
        frame = frame_of(motion[:2, :3], motion[:2, 3], motion=motion)
        camera = Camera(CameraSpec(projection=projection), frame, aspect=aspect)
        right, up, depth = camera.view(motion[:, :3]).T
        half = camera.height / 2 if projection == "orthographic" else depth * math.tan(math.radians(22.5))
        across, along = right / (half * aspect), up / half
        radius = motion[:, 3] / half
        assert (depth > 0).all() and max((np.abs(across) + radius / aspect).max(), (np.abs(along) + radius).max()) < 1.0
        # 1/1.12 of the picture is filled along one axis; spheres reach over that part by their radii and by the perspective.
        assert max(np.ptp(across), np.ptp(along)) > 2 * 0.6


def test_few_of_many_particles_that_fly_far_away_do_not_make_the_others_small() -> None:
    random = np.random.default_rng(2)
    near = random.normal(size=(5, 40, 3))
    motion = np.concatenate([near, np.full((5, 40, 1), 0.05)], axis=2)
    gone = motion.copy()
    gone[:, 7, 0] = [1.0, 10.0, 100.0, 1e3, 1e4]
    heights = []
    for each in (motion, gone):
        frame = frame_of(each[0, :, :3], 0.05, motion=each.reshape(-1, 4))
        heights.append(Camera(CameraSpec(), frame, aspect=1.5).visible_height)
    assert heights[1] == pytest.approx(heights[0], rel=0.3)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("flat_axis", "dimensions", "backward", "up"),
    [
        (2, 3, (0, 0, 1), (0, 1, 0)),
        (1, 3, (0, -1, 0), (0, 0, 1)),
        (0, 3, (1, 0, 0), (0, 0, 1)),
        (None, 2, (0, 0, 1), (0, 1, 0)),
    ],
)
def test_flat_scene_is_seen_face_on(flat_axis: int | None, dimensions: int, backward: tuple, up: tuple) -> None:
    position = np.random.default_rng(1).normal(size=(20, 3))
    if flat_axis is not None:
        position[:, flat_axis] = 4.0
    camera = Camera(CameraSpec(), frame_of(position, 0.1), aspect=1.5, dimensions=dimensions)
    np.testing.assert_allclose(camera.backward, backward, atol=1e-12)
    np.testing.assert_allclose(camera.up, up, atol=1e-12)


def test_plane_of_an_orbit_is_told_by_the_velocity() -> None:
    frame = frame_of([[0, 0, 0], [1, 0, 0]], 0.05, velocity=np.array([[0, 0, 0], [0, 0, 1.0]]))
    np.testing.assert_allclose(Camera(CameraSpec(), frame, aspect=1.5).backward, (0, -1, 0), atol=1e-12)


def test_solid_scene_is_seen_at_an_angle() -> None:
    camera = Camera(CameraSpec(), crowd(), aspect=1.5)
    assert np.abs(camera.backward).min() > 0.2


def test_center_of_mass_is_looked_at() -> None:
    snapshot = Snapshot(
        position=np.array([[0.0, 0, 0], [1.0, 0, 0]]),
        velocity=np.array([[0.0, 0, 0], [0, 1.0, 0]]),
        mass=np.array([1.0, 1e-6]),
        radius=np.array([0.1, 0.01]),
        charge=np.zeros(2),
        color=np.ones((2, 3)),
        free=np.ones((2, 3), bool),
        name=("sun", "earth"),
        springs=Springs(between=np.array([[0, 1]]), color=np.ones((1, 3))),
    )
    camera = Camera(CameraSpec(), Frame.of(snapshot), aspect=16 / 9)
    np.testing.assert_allclose(camera.target, 0.0, atol=1e-5)
    _, up, _ = camera.view(np.array([0.0, 1.01, 0.0]))
    assert up < camera.visible_height / 2, "the whole orbit is in view, not only where the bodies start"


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_printed_camera_is_the_same_camera(projection: str) -> None:
    frame = crowd()
    camera = Camera(CameraSpec(projection=projection), frame, aspect=1.5)
    camera.rotate(0.3, -0.2)
    camera.pan(0.1, 0.2)
    camera.zoom(1.7)
    again = Camera(CameraSpec(**yaml.safe_load(camera.as_yaml())["view"]["camera"]), frame, aspect=1.5)
    np.testing.assert_allclose(again.view(frame.position), camera.view(frame.position), atol=1e-3)
    assert again.visible_height == pytest.approx(camera.visible_height, rel=1e-4)


def test_the_picture_follows_a_dragged_mouse() -> None:
    camera = Camera(FRONT, frame_of([0, 0, 0], 1.0), aspect=1.5)
    near, height = np.array([0.0, 0.0, 1.0]), camera.visible_height
    camera.rotate(0.05, 0.0)
    assert camera.view(near)[0] > 0.1 and abs(camera.view(near)[1]) < 1e-9
    camera.rotate(-0.05, 0.05)
    assert abs(camera.view(near)[0]) < 1e-9 and camera.view(near)[1] > 0.1
    camera.reset()
    camera.pan(0.25, -0.125)
    np.testing.assert_allclose(camera.view(np.zeros(3))[:2] / height, (0.25, -0.125), atol=1e-12)
    camera.zoom(2.0)
    assert camera.visible_height == pytest.approx(height / 2)
    camera.reset()
    np.testing.assert_allclose(camera.position, FRONT.position)


def test_rotation_stops_at_the_poles() -> None:
    camera = Camera(CameraSpec(), crowd(), aspect=1.5)
    for _ in range(20):
        camera.rotate(0.1, -0.3)
        assert camera.up @ camera.axis > 0.0
        np.testing.assert_allclose(np.linalg.norm(camera.backward), 1.0)
        np.testing.assert_allclose(camera.right @ camera.backward, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    "camera",
    [
        CameraSpec(position=(0, 0, 5), look_at=(0, 0, 0), up=(0, 0, 1)),
        CameraSpec(position=(1, 1, 1), look_at=(1, 1, 1)),
        CameraSpec(up=(0, 0, 0)),
    ],
    ids=["up along the line of sight", "position at its target", "no up at all"],
)
def test_impossible_cameras_still_see(camera: CameraSpec) -> None:
    assert np.isfinite(Camera(camera, crowd(), aspect=1.5).view(crowd().position)).all()


def test_keys_do_what_the_help_says() -> None:
    frame = crowd()
    camera = Camera(CameraSpec(), frame, aspect=1.5)
    start = camera.position
    controls = Controls()

    def press(key: str, *, shift: bool = False) -> None:
        controls.press(key, shift=shift, camera=camera, frame=frame, aspect=1.5)

    press(" ")
    assert not controls.running
    press(" ")
    press("Right")
    press("Right", shift=True)
    assert not controls.running and controls.take_steps() == 51 and controls.take_steps() == 0
    for key, request in (("BackSpace", "restart"), ("c", "screenshot"), ("k", "print_camera")):
        press(key)
        assert controls.take(request) and not controls.take(request)
    press("h")
    press("t")
    assert controls.help and not controls.trails
    for key, axis in (("x", 0), ("y", 1), ("z", 2)):
        press(key)
        assert abs(camera.backward[axis]) == pytest.approx(1.0)
    press("r")
    np.testing.assert_allclose(camera.position, start)
    camera.pan(5, 5)
    press("f")
    assert np.abs(camera.view(camera.target)[:2]).max() < 1e-9
    press("q")
    assert controls.quit


def test_mouse_moves_the_camera() -> None:
    frame = crowd()
    cases = [
        ({"LMB"}, "backward"),
        ({"RMB"}, "target"),
        ({"LMB", "Shift"}, "target"),
        ({"LMB", "Control"}, "distance"),
        ({"MMB"}, "distance"),
        ({"i"}, "distance"),
    ]
    for held, changed in cases:
        camera = Camera(CameraSpec(), frame, aspect=1.5)
        before = {name: np.copy(getattr(camera, name)) for name in ("backward", "target", "distance")}
        controls = Controls()
        controls.move((0.9, 0.9), set(), camera=camera, seconds=0.1, aspect=1.5)
        controls.move((0.2, 0.2), held, camera=camera, seconds=0.0, aspect=1.5)
        controls.move((0.3, 0.4), held, camera=camera, seconds=0.1, aspect=1.5)
        for name, value in before.items():
            assert np.allclose(getattr(camera, name), value) == (name != changed), (held, name)
