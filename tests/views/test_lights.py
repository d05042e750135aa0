"""Several lights in one picture: colours, brightness, and a shadow of each."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pictures import FRONT, SCENE_WITH_VIEW, draw, frame_of, view_spec

from mpp_taichi.device import backends
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.view_spec import BodyLightSpec, BodyViewSpec, LightSpec
from mpp_taichi.views.srgb import linear_from_srgb

SIZE = (160, 160)
PARALLEL = replace(FRONT, projection="orthographic", height=4.0)  # 40 pixels a length
RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
AMBIENT, SPECULAR = 0.03, 0.18
SUN = BodyViewSpec(light=BodyLightSpec())


@pytest.fixture(autouse=True)
def fresh_runtime():
    """Not after each test here: all draw with the kernels of one runtime."""
    return


@pytest.fixture(scope="module", autouse=True)
def cpu():
    """One backend for all pictures here."""
    backends.start("cpu", "f64")
    yield
    backends.stop()


def _light(frame, spec) -> np.ndarray:
    return linear_from_srgb(draw(frame, spec, SIZE) / 255.0)


def _at(light: np.ndarray, x: float, y: float) -> np.ndarray:
    return light[round(79.5 - 40 * y), round(79.5 + 40 * x)]


def _expected(x: float, y: float, lights: list) -> np.ndarray:
    """Light of a white unit sphere at the origin, seen from +z, under lights in the directions and with the colours given."""
    normal = np.array([x, y, math.sqrt(1.0 - x * x - y * y)])
    total = np.full(3, AMBIENT)
    for direction, color in lights:
        diffuse = max(float(normal @ direction), 0.0)
        half = np.add(direction, (0.0, 0.0, 1.0))
        shine = float(normal @ half / np.linalg.norm(half)) ** 32 if diffuse > 0.0 else 0.0
        total = total + (diffuse + SPECULAR * shine) * np.array(color)
    return np.minimum(total, 1.0)


@pytest.mark.sampled(3)
def test_two_suns_light_two_halves_in_their_colors_and_both_add_up() -> None:
    frame = frame_of([[0, 0, 0], [1e4, 0, 0], [0, 1e4, 0]], [1.0, 1.0, 1.0], [(1, 1, 1), RED, BLUE])
    light = _light(frame, view_spec(PARALLEL, bodies={(1, 1): SUN, (2, 1): SUN}, ambient=AMBIENT))
    suns = [((1, 0, 0), RED), ((0, 1, 0), BLUE)]
    for x, y in ((0.6, -0.5), (-0.5, 0.6), (0.5, 0.5), (-0.5, -0.5)):
        # A pixel is 1/40 wide; its middle is at most half of it away, and the mean light within it at most the same.
        # Displayed values are rounded to 1/255.
        np.testing.assert_allclose(_at(light, x, y), _expected(x, y, suns), atol=0.04, err_msg=f"{x}, {y}")
    assert (_at(light, 0.6, -0.5)[[1, 2]] < 0.04).all() and (_at(light, -0.5, 0.6)[[0, 1]] < 0.04).all()
    np.testing.assert_allclose(_at(light, -0.5, -0.5), AMBIENT, atol=0.005, err_msg="no light but the ambient")


def test_the_shadow_of_one_light_is_lit_by_the_other() -> None:
    red, blue = (0.8, 0.0, 0.6), (-0.6, 0.0, 0.8)
    lights = (LightSpec(direction=red, color=RED), LightSpec(direction=blue, color=BLUE))
    frame = frame_of([[0, 0, 0], [1.6, 0, 1.2]], [1.0, 0.2])  # the small sphere stands before the red light
    light = _light(frame, view_spec(PARALLEL, light=lights, ambient=AMBIENT))
    spot = 0.55  # in the shadow, which reaches from 0.64 to 0.92 and less far in depth; see below
    normal = np.array([spot, 0.0, math.sqrt(1.0 - spot**2)])
    aside = np.linalg.norm(np.array([1.6, 0.0, 1.2]) - normal - (np.array([1.6, 0.0, 1.2]) - normal) @ red * np.array(red))
    assert aside > 0.25, "the spot lies beside the shadow"
    np.testing.assert_allclose(_at(light, spot, 0.0), _expected(spot, 0.0, [(red, RED), (blue, BLUE)]), atol=0.04)
    # The axis of the shadow meets the sphere at x = 0.8, which the small sphere does not hide from above at x < 1.4.
    np.testing.assert_allclose(_at(light, 0.75, 0.0), _expected(0.75, 0.0, [(blue, BLUE)]), atol=0.04)
    assert _at(light, 0.75, 0.0)[0] < 0.035 < 0.15 < _at(light, 0.55, 0.0)[2]


def test_a_single_sun_is_white_and_a_given_color_and_brightness_count() -> None:
    frame = frame_of([[0, 0, 0], [1e4, 0, 0]], 1.0, [(1, 1, 1), RED])

    def spot(**others: object) -> np.ndarray:
        sun = BodyViewSpec(light=BodyLightSpec(**others))
        return _at(_light(frame, view_spec(PARALLEL, bodies={(1, 1): sun}, ambient=0.0)), 0.5, 0.0)

    plain, dim, green = spot(), spot(brightness=0.5), spot(color=GREEN)
    assert plain[0] == plain[1] == plain[2] > 0.4
    np.testing.assert_allclose(dim, 0.5 * plain, atol=0.005)  # displayed values are rounded to 1/255
    assert green[1] == plain[1] and green[0] == green[2] == 0.0


def test_a_dark_color_of_a_body_is_a_hue_and_no_lack_of_light() -> None:
    frame = frame_of([[0, 0, 0], [1e4, 0, 0], [0, 1e4, 0]], 1.0, [(1, 1, 1), (0.5, 0, 0), BLUE])
    light = _light(frame, view_spec(PARALLEL, bodies={(1, 2): SUN}, ambient=0.0))
    np.testing.assert_allclose(_at(light, 0.6, -0.5), _expected(0.6, -0.5, [((1, 0, 0), RED)]) - AMBIENT, atol=0.04)


def _loaded(folder, view: str):
    (folder / "scene.yaml").write_text(SCENE_WITH_VIEW.replace("VIEW", view), encoding="utf-8")
    return load_scene(folder / "scene.yaml").view


def test_lights_are_one_or_a_list_and_a_body_is_a_light_by_a_word_or_a_mapping(tmp_path) -> None:
    assert _loaded(tmp_path, "light: {direction: [1, 0, 0]}").light == (LightSpec(direction=(1.0, 0.0, 0.0)),)
    two = _loaded(tmp_path, "light: [{direction: [1, 0, 0]}, {direction: [0, 1, 0], color: red, brightness: 2}]").light
    assert two == (LightSpec((1.0, 0.0, 0.0)), LightSpec((0.0, 1.0, 0.0), color=RED, brightness=2.0))
    assert _loaded(tmp_path, "light:").light == ()
    bodies = _loaded(tmp_path, "bodies: {sun: {light: true}, moon: {light: {brightness: 0.1}}}").bodies
    assert [body.light for body in bodies.values()] == [BodyLightSpec(), BodyLightSpec(brightness=0.1)]
    assert _loaded(tmp_path, "bodies: {sun: {light: false}}").bodies[0, 1].light is None


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("view", "fault"),
    [
        ("light: [{direction: [1, 0, 0]}, {direction: [0, 0, 0]}]", ":8:47: view.light[1].direction: must not be [0, 0, 0]"),
        ("light: {direction: [0, 0, 0]}", ":8:22: view.light.direction: must not be [0, 0, 0]"),
        ("bodies: {sun: {light: maybe}}", ":8:25: view.bodies.sun.light: must be true, false or a mapping of keys, not 'm"),
        ("bodies: {sun: {light: {colour: red}}}", "view.bodies.sun.light.colour: unknown key 'colour', did you mean 'color'?"),
    ],
)
def test_faults_of_lights_are_told_with_their_place(tmp_path, view: str, fault: str) -> None:
    with pytest.raises(SceneError) as caught:
        _loaded(tmp_path, view)
    assert fault in str(caught.value), caught.value
