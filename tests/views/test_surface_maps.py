"""Lights at night, clouds, slopes and highlights of bodies: where they are seen, and what scenes may ask for."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pictures import FRONT, SCENE_WITH_VIEW, draw, frame_of, view_spec
from PIL import Image

from mpp_taichi.device import backends
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.body_view_spec import BodyViewSpec, CloudsSpec, NightSpec, NormalSpec, SpecularSpec, SpinSpec, TextureSpec
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.view_spec import CameraSpec, LightSpec
from mpp_taichi.views import map_patterns, patterns, relief, surfaces
from mpp_taichi.views.renderer import LIGHT
from mpp_taichi.views.sphere_noise import directions
from mpp_taichi.views.srgb import linear_from_srgb
from mpp_taichi.views.surface_parts import CLOUDS, GLOSS, NIGHT, RELIEF, SURFACES

SIZE = (160, 160)
PARALLEL = replace(FRONT, projection="orthographic", height=4.0)  # 40 pixels a length
# Seen from +x with z up: the prime meridian is in the middle, longitudes grow to the right.
ASIDE = CameraSpec(position=(10, 0, 0), look_at=(0, 0, 0), up=(0, 0, 1), projection="orthographic", height=4.0)
BLACK = (0.0, 0.0, 0.0)
PARTS = surfaces._parts
# Light between two of the 255 displayed values, at most: half of 1/255 times the slope 2.4 of the curve, and dither.
ROUNDED = 0.006


@pytest.fixture(autouse=True)
def fresh_runtime():
    """Not after each test here: all draw with the kernels of one runtime."""
    return


@pytest.fixture(scope="module")
def cpu():
    """One backend for all pictures here; double precision, which pictures must not notice."""
    backends.start("cpu", "f64")
    with pytest.MonkeyPatch.context() as patch:  # one kernel with all parts in place of one for each part: it takes two seconds
        patch.setattr(surfaces, "_parts", lambda body: PARTS(body) and SURFACES | NIGHT | CLOUDS | RELIEF | GLOSS)
        yield
    backends.stop()


def _saved(folder, name: str, picture: np.ndarray) -> str:
    Image.fromarray(np.asarray(picture, dtype=np.uint8)).save(folder / name)
    return str(folder / name)


def _light(body: BodyViewSpec, color=BLACK, camera=PARALLEL, time=0.0, **others) -> np.ndarray:
    frame = frame_of([0, 0, 0], 1.0, color, time=time)
    return linear_from_srgb(draw(frame, view_spec(camera, bodies={(0, 1): body}, **others), SIZE) / 255.0)


# Lights at night


@pytest.mark.sampled(3)
def test_lights_at_night_are_seen_where_it_is_dark_and_fade_over_the_terminator(cpu, tmp_path) -> None:
    black = TextureSpec(file=_saved(tmp_path, "black.png", np.zeros((32, 64, 3))))
    night = NightSpec(file=_saved(tmp_path, "white.png", np.full((32, 64, 3), 255)), brightness=0.5)
    east, north = LightSpec(direction=(1, 0, 0)), LightSpec(direction=(0, 1, 0))
    body = BodyViewSpec(texture=black, night=night)
    row = _light(body, light=(east,), ambient=0.0)[79, 40:120, 1]
    height = (np.arange(80) + 0.5 - 40) / 40  # of the light over the horizon, its sine
    assert (np.abs(row[height < -0.11][1:] - 0.5) < ROUNDED).all() and (row[height > 0.11] == 0.0).all()
    middle = row[39:41]  # at ∓1/80: half of it, less or more by 3/4 · 1/80 / 0.1 of the smoothed step's slope
    np.testing.assert_allclose(middle, 0.5 * (0.5 + np.array([1, -1]) * 0.75 / 80 / 0.1), atol=ROUNDED)
    both = _light(body, light=(east, north), ambient=0.0)[:, :, 1]
    assert both[100, 60] > 0.49 and both[60, 60] == both[100, 100] == both[60, 100] == 0.0, "night is where no light is"


def test_cities_lie_on_the_land_of_the_continents_with_their_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patterns, "ROWS", 96)
    monkeypatch.setattr(map_patterns, "ROWS", 96)
    light = map_patterns.night_picture("cities", 3).sum(axis=2)
    _, depth = patterns.height_and_depth(directions(96), patterns.random_of("continents", 3))
    assert light.max() > 0 and light[depth > 0.0].sum() > 0.8 * light.sum(), "but for the glow of harbours over the sea"
    np.testing.assert_array_equal(map_patterns.height_picture("mountains", 3) > 0.0, depth > 0.0)
    assert (map_patterns.night_picture("cities", 4).sum(axis=2) != light).any()


# Clouds


def _half_clouds(folder, name: str = "clouds.png") -> str:
    """Green clouds on the half with longitudes below 0, half as dense in the southern hemisphere; red where they are clear."""
    picture = np.zeros((32, 64, 4), np.uint8)
    picture[:, :, 0] = 255
    picture[:, :32] = (0, 255, 0, 255)
    picture[16:, :32, 3] = 128
    return _saved(folder, name, picture)


def test_clouds_cover_the_surface_by_their_opacity_and_turn_with_a_period_of_their_own(cpu, tmp_path) -> None:
    blue = TextureSpec(file=_saved(tmp_path, "blue.png", np.tile(np.array([0, 0, 255]), (32, 64, 1))))
    spin = SpinSpec(period=8.0)
    ahead = (LightSpec(direction=(1, 0, 0)),)

    def seen(time: float, **clouds) -> tuple[np.ndarray, np.ndarray]:
        body = BodyViewSpec(texture=blue, clouds=CloudsSpec(file=_half_clouds(tmp_path), **clouds), spin=spin)
        light = _light(body, camera=ASIDE, time=time, light=ahead, ambient=0.0)
        bare = _light(replace(body, clouds=None), camera=ASIDE, time=time, light=ahead, ambient=0.0)[:, :, 2:]
        return light[68, [60, 100]] / bare[68, [60, 100]], light[92, [60, 100]] / bare[92, [60, 100]]

    north, south = seen(0.0)
    np.testing.assert_allclose(north, [[0, 1, 0], [0, 0, 1]], atol=0.02)  # a ratio of values rounded to 1/255 of some 0.8
    half = 128 / 255
    np.testing.assert_allclose(south, [[0, half, 1 - half], [0, 0, 1]], atol=0.02)
    np.testing.assert_allclose(seen(0.0, opacity=0.25)[0][0], [0, 0.25, 0.75], atol=0.02)
    np.testing.assert_allclose(seen(4.0)[0], [[0, 0, 1], [0, 1, 0]], atol=0.02, err_msg="with the surface, by half a turn")
    np.testing.assert_allclose(seen(4.0, period=4.0)[0], north, atol=0.02, err_msg="by a whole turn")
    np.testing.assert_allclose(seen(4.0, period=-8.0)[0], seen(4.0)[0], atol=0.02)


def test_clouds_hide_lights_at_night_and_a_grey_picture_is_their_opacity(cpu, tmp_path) -> None:
    night = NightSpec(file=_saved(tmp_path, "white.png", np.full((32, 64, 3), 255)), brightness=0.8)
    grey = CloudsSpec(file=_saved(tmp_path, "grey.png", np.full((32, 64), 51)))  # a fifth of 255
    body = BodyViewSpec(night=night, clouds=grey)
    away, ahead = (LightSpec(direction=(0, 0, -1)),), (LightSpec(direction=(0, 0, 1)),)
    np.testing.assert_allclose(_light(body, light=away, ambient=0.0)[79, 79], 0.8 * 0.8, atol=ROUNDED)
    # A black body has a highlight of 0.18, four fifths of which shine through.
    np.testing.assert_allclose(_light(body, light=ahead, ambient=0.0)[79, 79], 0.2 + 0.8 * 0.18, atol=ROUNDED)


# Slopes


def test_slopes_of_a_height_map_are_its_gradient() -> None:
    rows = 180
    direction = directions(rows).astype(float)
    latitude = np.arcsin(direction[..., 2])
    x, y, z = np.moveaxis(direction, 2, 0)
    height = 0.5 + 0.25 * x * y + 0.2 * z  # smooth on the whole sphere
    level = np.cos(latitude)
    gradient = 0.25 * np.stack([y, x, np.zeros_like(x)], axis=2) + 0.2 * np.array([0.0, 0.0, 1.0])
    east = np.stack([-y / level, x / level, np.zeros_like(x)], axis=2)
    north = np.stack([-z * x / level, -z * y / level, level], axis=2)
    expected = 0.5 * relief.HEIGHT * np.stack([(gradient * each).sum(axis=2) for each in (east, north)], axis=2)
    found = relief.slopes_of_heights(height, 0.5)
    wide = np.abs(latitude) < math.acos(relief.NARROWEST)
    # Sobel's differences and its mean across are right to the square of the step, 1/57 rad, times derivatives of up to 2 and,
    # beside the poles, over cos φ once more.
    error = np.abs(found - expected).max(axis=2) / (0.5 * relief.HEIGHT)
    assert (error[wide] < 2.0 * (np.pi / rows) ** 2 / level[wide]).all()


def test_a_normal_map_has_the_slopes_of_the_height_map_from_which_it_was_made() -> None:
    slopes = relief.slopes_of_heights(map_patterns.height_picture("craters", 1), 2.0)
    normal = np.concatenate([-slopes, np.ones((*slopes.shape[:2], 1))], axis=2)
    normal /= np.linalg.norm(normal, axis=2)[..., None]
    picture = np.rint(127.5 * (normal + 1.0)).astype(np.uint8)
    # Rounding to 1/127.5, and once more by taking 127 and 128 both as 0, in each of the two components of a quotient.
    steep = np.abs(slopes).max()
    np.testing.assert_allclose(relief.slopes_of_picture(picture, 1.0), slopes, atol=(1 + steep) ** 2 / 127.5)
    level = np.tile(np.array([128, 127, 255], np.uint8), (4, 8, 1))
    np.testing.assert_array_equal(relief.slopes_of_picture(level, 3.0), 0.0)


def test_light_on_a_slope_follows_from_its_normal(cpu, tmp_path) -> None:
    picture = np.tile(np.array([200, 90, 222], np.uint8), (32, 64, 1))  # everywhere the same slopes to the east and the north
    slope = -(np.array([200, 90, 222]) - 127.5 - np.array([0.5, -0.5, 0.5]))[:2] / 94.0
    white = TextureSpec(file=_saved(tmp_path, "white.png", np.full((32, 64, 3), 255)))
    body = BodyViewSpec(texture=white, normal=NormalSpec(file=_saved(tmp_path, "normal.png", picture)))
    toward = np.array([0.8, -0.36, 0.48])
    light = _light(body, camera=ASIDE, light=(LightSpec(direction=tuple(toward)),), ambient=0.0)[:, :, 1]
    for right, up in ((0.0, 0.0), (0.5, 0.3), (-0.6, 0.4), (0.2, -0.5)):
        normal = np.array([math.sqrt(1.0 - right**2 - up**2), right, up])
        east = np.array([-normal[1], normal[0], 0.0]) / math.hypot(*normal[:2])
        sloping = normal - slope[0] * east - slope[1] * np.cross(normal, east)
        expected = max(float(sloping @ toward) / np.linalg.norm(sloping), 0.0)
        assert abs(expected - normal @ toward) > 0.05, "the slope matters"
        # The middle of a pixel is up to 1/80 away in both directions.
        assert light[round(79.5 - 40 * up), round(79.5 + 40 * right)] == pytest.approx(expected, abs=0.03), (right, up)


def test_level_ground_is_lit_as_without_slopes_and_slopes_make_no_light_at_night(cpu, tmp_path) -> None:
    white = TextureSpec(file=_saved(tmp_path, "white.png", np.full((32, 64, 3), 255)))
    level = NormalSpec(file=_saved(tmp_path, "level.png", np.full((32, 64), 100)))
    light = (LightSpec(direction=(1, 0, 0)),)
    plain = _light(BodyViewSpec(texture=white), light=light, ambient=0.0)
    np.testing.assert_allclose(_light(BodyViewSpec(texture=white, normal=level), light=light, ambient=0.0), plain, atol=ROUNDED)
    rough = NormalSpec(pattern="craters", strength=10.0)
    dark = _light(BodyViewSpec(texture=white, normal=rough), light=light, ambient=0.0)
    assert (dark[:, :79] == 0.0).all() and np.abs(dark - plain).max() > 0.3


# Highlights


def _half_gloss(folder) -> str:
    """Half of 255 in red, all of it in green and nothing in blue on longitudes below 0; nothing elsewhere."""
    picture = np.zeros((32, 64, 3))
    picture[:, :32] = (127.5, 255, 0)
    return _saved(folder, "gloss.png", picture)


@pytest.mark.parametrize("lights", [((1.0, -0.5, 0.2),), ((1.0, -0.5, 0.2), (0.3, -1.0, 0.0)), ()], ids=["one", "two", "none"])
def test_highlights_are_those_of_blinn_times_the_map(cpu, tmp_path, lights) -> None:
    """The light of a black body is the strength times the map times Σ (n·h)³², where the surface is turned to the light."""
    black = TextureSpec(file=_saved(tmp_path, "black.png", np.zeros((32, 64, 3))))
    body = BodyViewSpec(texture=black, specular=SpecularSpec(file=_half_gloss(tmp_path), strength=0.4))
    found = _light(body, camera=ASIDE, light=tuple(LightSpec(direction=each) for each in lights), ambient=0.0)
    eye = np.array([1.0, 0.0, 0.0])
    # Without a light in the scene: LIGHT of the renderer, to the right, up and into the picture, of a camera at +x.
    into_picture = np.array([-LIGHT[2], LIGHT[0], LIGHT[1]])
    toward = [np.array(each) / np.linalg.norm(each) for each in lights] or [into_picture]
    brightest = 0.0
    for row in range(42, 118, 4):
        for column in range(42, 118, 4):
            right, up = (column + 0.5 - 80) / 40, (79.5 - row) / 40
            if math.hypot(right, up) > 0.9 or abs(right) < 0.1:  # the rim, and the edge of the map, between two of its texels
                continue
            normal = np.array([math.sqrt(1.0 - right**2 - up**2), right, up])
            halves = [(each + eye) / np.linalg.norm(each + eye) for each in toward]
            shine = sum(max(float(normal @ half), 0.0) ** 32 for half, each in zip(halves, toward) if normal @ each > 0.0)
            gloss = 0.4 * np.array([127 / 255, 1.0, 0.0]) * (right < 0.0)
            # Within a pixel of 1/40 the normal turns by up to 1/40/(n·e), and 32 c³¹ √(1 − c²) is at most 3.5.
            error = ROUNDED + 0.4 * len(toward) * 0.5 * (3.5 / 40 / normal[0]) ** 2
            np.testing.assert_allclose(found[row, column], np.minimum(gloss * shine, 1.0), atol=error)
            brightest = max(brightest, float((gloss * shine).max()))
    assert brightest > 0.2, "the highlight lies on the half with a map"


def test_highlights_are_hidden_by_clouds_and_shadows_and_oceans_lie_between_the_continents(cpu, tmp_path, monkeypatch) -> None:
    black = TextureSpec(file=_saved(tmp_path, "black.png", np.zeros((32, 64, 3))))
    white = SpecularSpec(file=_saved(tmp_path, "white.png", np.full((32, 64), 255)), strength=0.5)
    ahead = (LightSpec(direction=(0, 0, 1)),)
    body = BodyViewSpec(texture=black, specular=white)
    assert _light(body, light=ahead, ambient=0.0)[79, 79] == pytest.approx([0.5] * 3, abs=ROUNDED)
    dark = CloudsSpec(file=_saved(tmp_path, "dark.png", np.tile(np.array([0, 0, 0, 51]), (32, 64, 1))))
    assert _light(replace(body, clouds=dark), light=ahead, ambient=0.0)[79, 79] == pytest.approx([0.8 * 0.5] * 3, abs=ROUNDED)
    frame = frame_of([[0, 0, 0], [0, 0, 6]], [1.0, 0.4], BLACK)  # the camera looks past the small body, which hides the light
    looks = replace(PARALLEL, position=(2.0, 0.0, 10.0))
    seen = draw(frame, view_spec(looks, bodies={(0, 1): body}, light=(LightSpec(direction=(0, 0, 1)),), ambient=0.0), SIZE)
    lone = draw(frame_of([0, 0, 0], 1.0, BLACK), view_spec(looks, bodies={(0, 1): body}, light=ahead, ambient=0.0), SIZE)
    brightest = np.unravel_index(lone.max(axis=2).argmax(), SIZE)
    assert lone[brightest].min() > 100 and seen[brightest].max() == 0
    monkeypatch.setattr(patterns, "ROWS", 96)
    monkeypatch.setattr(map_patterns, "ROWS", 96)
    share = map_patterns.gloss_picture("oceans", 3)[..., 0]
    height, depth = patterns.height_and_depth(directions(96), patterns.random_of("continents", 3))
    bare = patterns.ice_share(directions(96), height) == 0.0
    assert (share[bare & (depth > 0.0)] == 0).all() and (share[bare & (depth <= 0.0)] == round(255 * 0.55)).all()
    assert (bare & (depth <= 0.0)).sum() > 1000


# Scenes


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("view", "fault"),
    [
        ("bodies: {moon: {clouds: {file: none.png}}}", ":8:34: view.bodies.moon.clouds.file: there is no file 'none.png'"),
        ("bodies: {moon: {normal: {file: scene.yaml}}}", ":8:34: view.bodies.moon.normal.file: is no picture"),
        ("bodies: {moon: {clouds: {file: torn.png}}}", ":8:34: view.bodies.moon.clouds.file: is a damaged picture: image file"),
        ("bodies: {moon: {texture: {file: torn.jpg}}}", ":8:35: view.bodies.moon.texture.file: is a damaged picture: image"),
        ("bodies: {moon: {night: {pattern: cities}}}", ":8:26: view.bodies.moon.night: needs a light"),
        ("bodies: {sun: {light: true, clouds: {pattern: scattered}}}", ":8:39: view.bodies.sun.clouds: is not for a body that"),
        ("bodies: {moon: {clouds: {pattern: cities}}}", "view.bodies.moon.clouds.pattern: 'cities' is unknown"),
        ("bodies: {moon: {specular: {pattern: cities}}}", "view.bodies.moon.specular.pattern: 'cities' is unknown"),
        ("bodies: {moon: {specular: {file: none.png}}}", ":8:36: view.bodies.moon.specular.file: there is no file 'none.png'"),
        (
            "bodies: {sun: {light: true, specular: {pattern: oceans}}}",
            ":8:41: view.bodies.sun.specular: is not for a body",
        ),
        ("bodies: {moon: {normal: {}}}", "view.bodies.moon.normal: must have a file or a pattern"),
        ("bodies: {moon: {clouds: {pattern: scattered, period: 0}}}", ":8:56: view.bodies.moon.clouds.period: must not be 0"),
    ],
)
def test_faults_of_maps_are_told_with_their_place(tmp_path, view: str, fault: str) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
    for name in ("torn.png", "torn.jpg"):
        path = tmp_path / name
        Image.fromarray(noise).save(path)
        path.write_bytes(path.read_bytes()[:-2000])
    (tmp_path / "scene.yaml").write_text(SCENE_WITH_VIEW.replace("VIEW", view), encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path / "scene.yaml")
    assert fault in str(caught.value), caught.value


# Last, since it starts a runtime of its own


@pytest.mark.sampled(3)
def test_only_the_maps_that_a_view_asks_for_are_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    from mpp_taichi.views import _surface_shading

    def not_here(*_: object) -> None:
        raise AssertionError("compiled")

    for name in ("clouds_over", "night_light", "share_of_night", "sloping_normal", "gloss_at"):
        monkeypatch.setattr(_surface_shading, name, not_here)
    monkeypatch.setattr(surfaces, "_parts", PARTS)
    backends.start("cpu", "f32")
    try:
        light = (LightSpec(direction=(1, 0, 0)),)
        assert _light(BodyViewSpec(texture=TextureSpec(pattern="checker")), light=light).max() > 0.0
        with pytest.raises(Exception, match="compiled"):
            _light(BodyViewSpec(clouds=CloudsSpec(pattern="scattered")), light=light)
    finally:
        backends.stop()
