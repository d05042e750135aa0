"""The orientation of bodies that turn, and the precession of their axes."""

import math

import numpy as np
import pytest
from pictures import FRONT, frame_of

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.body_view_spec import SpinSpec
from mpp_taichi.scene.load import load_scene
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.spins import orientation

TILT = math.radians(23.4)
AXIS = (0.0, math.sin(TILT), math.cos(TILT))


def _oriented(spin: SpinSpec, time: float) -> np.ndarray:
    """Meridian, 90° east and pole in the coordinates of the scene."""
    camera = Camera(FRONT, frame_of([0, 0, 0], 1.0), aspect=1.0)
    return orientation(spin, time, camera) @ np.stack([camera.right, camera.up, -camera.backward])


def test_the_axis_goes_around_the_normal_of_the_reference_plane_in_its_period() -> None:
    spin = SpinSpec(period=1e9, axis=AXIS, precession=-40.0)  # as slow as to rest, and backwards, as the Earth's axis goes
    s, c = math.sin(TILT), math.cos(TILT)
    for quarter, pole in enumerate(([0, s, c], [s, 0, c], [0, -s, c], [-s, 0, c], [0, s, c])):
        frame = _oriented(spin, 10.0 * quarter)
        np.testing.assert_allclose(frame[2], pole, atol=1e-12, err_msg=str(quarter))  # rounding of a few products
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(_oriented(spin, 5.0)[2], [s * math.sqrt(0.5), s * math.sqrt(0.5), c], atol=1e-12)


def test_the_body_keeps_turning_about_its_moving_axis_and_the_meridian_is_counted_from_the_moving_node() -> None:
    spin, steady = SpinSpec(period=8.0, axis=AXIS, precession=40.0), SpinSpec(period=8.0, axis=AXIS)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # a turn by 90° about z
    np.testing.assert_allclose(_oriented(spin, 10.0), _oriented(steady, 10.0) @ quarter.T, atol=1e-12)
    np.testing.assert_array_equal(_oriented(spin, 0.0), _oriented(steady, 0.0))
    np.testing.assert_allclose(_oriented(spin, 20.0)[2], [0.0, -AXIS[1], AXIS[2]], atol=1e-12)


def test_a_precession_without_a_period_is_refused(tmp_path) -> None:
    (tmp_path / "scene.yaml").write_text(
        "particles:\n  - body: {name: a, mass: 1, position: [0, 0, 0]}\nforces: []\nintegrator: {leapfrog: {dt: 0.1}}\n"
        "run: {duration: 1}\nview:\n  bodies: {a: {spin: {period: 1, precession: 0}}}\n",
        encoding="utf-8",
    )
    with pytest.raises(SceneError, match=r":7:46: view\.bodies\.a\.spin\.precession: must not be 0"):
        load_scene(tmp_path / "scene.yaml")
