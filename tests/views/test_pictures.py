"""Every key of `view:` in the picture: display scales, surfaces, light, shadow, sky, colours, arrows, axes and grid."""

import math
from dataclasses import replace

import numpy as np
import pytest
from function_values import function_values
from pictures import BLACK, FRONT, SCENE_WITH_VIEW, draw, frame_of, view_spec
from PIL import Image

from mpp_taichi.device import backends
from mpp_taichi.errors import OutputError, SceneError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import CameraSpec
from mpp_taichi.scene.view_spec import (
    ArrowsSpec,
    AxesSpec,
    BodyLightSpec,
    BodyViewSpec,
    ColorBySpec,
    ColorScaleSpec,
    GridSpec,
    GroupColorsSpec,
    LightSpec,
    SkySpec,
    SpinSpec,
    SpringColorBySpec,
    TextureSpec,
    ViewSpec,
)
from mpp_taichi.views import patterns, textures
from mpp_taichi.views._shadows import covered_share
from mpp_taichi.views.appearance import Appearance
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.color_maps import COLOR_TABLES, NOWHERE, colors_of
from mpp_taichi.views.legend import legend_lines, number_text
from mpp_taichi.views.marks import round_number
from mpp_taichi.views.sky import Sky
from mpp_taichi.views.srgb import linear_from_srgb

SIZE = (160, 160)
PARALLEL = replace(FRONT, projection="orthographic", height=4.0)


@pytest.fixture(autouse=True)
def fresh_runtime():
    """Not after each test here: all draw with the kernels of one runtime."""
    return


@pytest.fixture(scope="module")
def cpu():
    """One backend for all pictures here; double precision, which pictures must not notice."""
    backends.start("cpu", "f64")
    yield
    backends.stop()


# Display scales


def test_moons_are_drawn_farther_out_and_larger_and_nothing_else_moves() -> None:
    frame = frame_of([[0, 0, 0], [10, 0, 0], [10, 1, 0], [10, 1, 0.25]], [1.0, 0.1, 0.1, 0.1])
    bodies = {
        (3, 1): BodyViewSpec(around=2, distance_scale=4.0),  # listed before the one it is around
        (2, 1): BodyViewSpec(around=1, distance_scale=3.0, radius_scale=5.0),
    }
    dressed = Appearance(ViewSpec(bodies=bodies)).dress(frame)
    np.testing.assert_allclose(dressed.position, [[0, 0, 0], [10, 0, 0], [10, 3, 0], [10, 3, 1]])
    np.testing.assert_allclose(dressed.radius, [1.0, 0.1, 0.5, 0.1])
    np.testing.assert_array_equal(frame.position[2], [10, 1, 0])
    assert Appearance(ViewSpec()).dress(frame) is frame


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("view", "fault"),
    [
        ("bodies: {son: {light: true}}", ":8:17: view.bodies.son: no particle is called 'son', did you mean 'sun'?"),
        ("bodies: {moon: {distance_scale: 3}}", ":8:35: view.bodies.moon.distance_scale: must say around:"),
        ("bodies: {moon: {around: sun}, sun: {around: moon}}", ":8:11: view.bodies: bodies are drawn around one another"),
        ("bodies: {moon: {texture: {file: none.png}}}", ":8:35: view.bodies.moon.texture.file: there is no file 'none.png'"),
        ("bodies: {moon: {texture: {file: scene.yaml}}}", ":8:35: view.bodies.moon.texture.file: is no picture"),
        ("bodies: {moon: {texture: {}}}", "view.bodies.moon.texture: must have a file or a pattern"),
        ("bodies: {moon: {spin: {period: 0}}}", ":8:34: view.bodies.moon.spin.period: must not be 0"),
        ("sky: {stars: 5, file: scene.yaml}", "view.sky"),
        ("color_by: {speed: {}, mass: {}}", ":8:13: view.color_by: must be one quantity, not 2"),
        ("color_by: {sped: {}}", ":8:14: view.color_by.sped: unknown key 'sped', did you mean 'speed'?"),
        ("color_by: {speed: {range: [2, 1]}}", ":8:29: view.color_by.speed.range: must go from low to high"),
        ("color_by: {speed: {range: [0, 1], logarithmic: true}}", "must be above 0 for a logarithm"),
        ("color_by: {group: {of: [sun, mars]}}", ":8:32: view.color_by.group.of[1]: no particle is called 'mars'"),
        ("arrows: {of: [mars]}", ":8:17: view.arrows.of[0]: no particle is called 'mars'"),
    ],
)
def test_faults_of_a_view_are_told_with_their_place(tmp_path, view: str, fault: str) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE_WITH_VIEW.replace("VIEW", view), encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert fault in str(caught.value), caught.value


def test_names_of_a_view_become_indices(tmp_path) -> None:
    view = "bodies: {moon: {around: sun, distance_scale: 2}}\n  color_by: {group: }\n  arrows: {of: [moon]}"
    (tmp_path / "scene.yaml").write_text(SCENE_WITH_VIEW.replace("VIEW", view), encoding="utf-8")
    found = load_scene(tmp_path / "scene.yaml").view
    assert found.bodies == {(1, 1): BodyViewSpec(around=0, distance_scale=2.0)}
    assert found.color_by is not None and found.color_by.group == GroupColorsSpec(of=(("sun", 0, 1), ("moon", 1, 1)))
    assert [arrows.of for arrows in found.arrows] == [((1, 1),)]


# Colours


def test_color_tables_are_the_published_ones() -> None:
    colormaps = pytest.importorskip("matplotlib").colormaps
    share = np.linspace(0.0, 1.0, 1001)
    for ours, theirs in (("viridis", "viridis"), ("cividis", "cividis"), ("diverging", "coolwarm")):
        # matplotlib takes the nearest of 256 entries, half an entry away at most: by less than 0.02 in any of these maps.
        assert np.abs(colors_of(share, ours) - colormaps[theirs](share)[:, :3]).max() < 0.02


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("asked", "label"),
    [
        ({"speed": ColorScaleSpec()}, "speed [AU/day]"),
        ({"kinetic_energy": ColorScaleSpec()}, "kinetic energy [Msun AU²/day²]"),
        ({"index": ColorScaleSpec()}, "index"),
        ({"speed": ColorScaleSpec(label="how fast")}, "how fast"),
    ],
)
def test_the_legend_has_the_unit_of_the_scene(asked, label) -> None:
    units = {"length": "AU", "time": "day", "mass": "Msun"}
    frame = frame_of(np.zeros((2, 3)), 0.1, velocity=np.array([[3.0, 4, 0], [0, 0, 0]]), mass=np.ones(2), units=units)
    look = Appearance(ViewSpec(color_by=ColorBySpec(**asked)))
    look.dress(frame)
    assert legend_lines(look.legend())[0].startswith(f"{label}: ")


def test_colors_follow_the_quantity_and_the_legend_says_which() -> None:
    frame = frame_of(np.zeros((4, 3)), 0.1, velocity=np.array([[3.0, 4, 0], [0, 0, 0], [0, 2.5, 0], [np.nan, 0, 0]]))
    look = Appearance(ViewSpec(color_by=ColorBySpec(speed=ColorScaleSpec())))
    table = COLOR_TABLES["viridis"]
    colors = look.dress(frame).color
    np.testing.assert_allclose(colors[[0, 1]], table[[255, 0]])
    np.testing.assert_allclose(colors[2], (table[127] + table[128]) / 2)
    np.testing.assert_allclose(colors[3], NOWHERE)
    assert legend_lines(look.legend()) == ["speed: 0 ... 5 (viridis)"]
    slower = replace(frame, velocity=frame.velocity / 2.0)
    np.testing.assert_allclose(look.dress(slower).color[0], colors[2], err_msg="the range is that of all frames so far")


def test_fixed_range_logarithm_and_groups() -> None:
    frame = replace(frame_of(np.zeros((4, 3)), 0.1), mass=np.array([1.0, 10.0, 100.0, 0.0]))
    scale = ColorScaleSpec(map="cividis", range=(1.0, 100.0), logarithmic=True)
    colors = Appearance(ViewSpec(color_by=ColorBySpec(mass=scale))).dress(frame).color
    table = COLOR_TABLES["cividis"]
    np.testing.assert_allclose(colors[[0, 2]], table[[0, 255]])
    np.testing.assert_allclose(colors[1], (table[127] + table[128]) / 2)
    np.testing.assert_allclose(colors[3], NOWHERE, err_msg="0 has no logarithm")
    look = Appearance(ViewSpec(color_by=ColorBySpec(group=GroupColorsSpec(of=(("a", 0, 1), ("b", 1, 2))))))
    colors = look.dress(frame).color
    assert (colors[1] == colors[2]).all() and (colors[0] != colors[1]).any() and (colors[3] == 1.0).all()
    assert legend_lines(look.legend()) == ["groups: a, b"]


def test_strain_is_neutral_at_rest_and_has_two_signs() -> None:
    frame = frame_of(
        [[0, 0, 0], [1, 0, 0], [3, 0, 0], [3.5, 0, 0]],
        0.1,
        between=np.array([[0, 1], [1, 2], [2, 3]]),
        spring_color=np.ones((3, 3)),
        rest_length=np.array([1.0, 1.0, 1.0]),
        stiffness=np.array([1.0, 1.0, 4.0]),
    )
    for spec, largest in (
        (SpringColorBySpec(strain=ColorScaleSpec()), "1"),
        (SpringColorBySpec(tension=ColorScaleSpec()), "2"),
    ):
        look = Appearance(ViewSpec(spring_color_by=spec))
        red_less_blue = look.dress(frame).spring_color @ (1.0, 0.0, -1.0)
        assert red_less_blue[0] == pytest.approx(0.0, abs=0.01) and red_less_blue[1] > 0.2 > -0.2 > red_less_blue[2]
        assert f"-{largest} ... {largest}" in legend_lines(look.legend())[0]


def test_numbers_of_a_legend_can_be_told_apart() -> None:
    assert number_text(1.0004, 0.001) != number_text(1.0014, 0.001)
    assert number_text(1e-20, 1.0) == "0"
    assert [round_number(value) for value in (0.9, 1.3, 1.6, 3.4, 8e-7)] == pytest.approx([1, 1, 2, 5, 1e-6])


# Surfaces


def _globe(tmp_path, name: str = "globe.png", columns: int = 64) -> str:
    """Red where the longitude is below 0, green above; the north quarter blue."""
    picture = np.zeros((columns // 2, columns, 3), np.uint8)
    picture[:, : columns // 2, 0] = 255
    picture[:, columns // 2 :, 1] = 255
    picture[: columns // 8] = (0, 0, 255)
    Image.fromarray(picture).save(tmp_path / name)
    return str(tmp_path / name)


def test_texture_is_where_longitude_and_latitude_say(tmp_path) -> None:
    texture = textures.read_picture(_globe(tmp_path))
    for longitude, latitude, color in ((-1.0, 0.0, 0), (1.0, 0.0, 1), (3.0, -1.0, 1), (-3.0, -1.0, 0), (1.0, 1.5, 2)):
        x, y, z = math.cos(latitude) * math.cos(longitude), math.cos(latitude) * math.sin(longitude), math.sin(latitude)
        np.testing.assert_allclose(texture.light(np.array([x, y, z])), np.eye(3)[color], atol=1e-6)
    smallest = linear_from_srgb(texture.levels[-1] / 255.0).mean(axis=(0, 1))
    np.testing.assert_allclose(smallest, [0.375, 0.375, 0.25], atol=0.01, err_msg="smaller pictures keep the mean light")


def test_a_torn_picture_is_refused_in_a_line(tmp_path) -> None:
    path = tmp_path / "torn.png"
    path.write_bytes((tmp_path / _globe(tmp_path, "whole.png", 512)).read_bytes()[:500])
    with pytest.raises(OutputError, match=r"torn\.png: cannot read the picture"):
        textures.read_picture(str(path))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["banded", "continents", "coasts", "cratered", "checker"])
def test_patterns_repeat_and_have_no_seam(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patterns, "ROWS", 96)
    color = (0.7, 0.5, 0.3)
    picture = patterns.pattern_picture(name, 3, color)
    np.testing.assert_array_equal(picture, patterns.pattern_picture(name, 3, color))
    assert name == "checker" or (picture != patterns.pattern_picture(name, 4, color)).any()
    steps = np.abs(np.diff(picture.astype(int), axis=1)).mean(axis=(0, 2))
    seam = np.abs(picture[:, 0].astype(int) - picture[:, -1]).mean()
    assert seam <= steps.max(), "the first column follows the last as any follows the one before"


def test_a_body_turns_by_its_period_about_its_axis(cpu, tmp_path) -> None:
    texture = TextureSpec(file=_globe(tmp_path))
    # Seen from +x with z up: the prime meridian is in the middle, longitudes grow to the right.
    camera = CameraSpec(position=(10, 0, 0), look_at=(0, 0, 0), up=(0, 0, 1), projection="orthographic", height=4.0)
    spin = SpinSpec(period=8.0, axis=(0.0, 0.0, 1.0))
    for time, left, right in ((0.0, 0, 1), (2.0, 0, 0), (4.0, 1, 0), (-6.0, 0, 0), (6.0, 1, 1)):
        spec = view_spec(camera, bodies={(0, 1): BodyViewSpec(texture=texture, spin=spin)})
        picture = draw(frame_of([0, 0, 0], 1.0, time=time), spec, SIZE).astype(int)
        middle = picture[SIZE[1] // 2 + 10]
        assert np.argmax(middle[60]) == left and np.argmax(middle[100]) == right, time
        assert np.argmax(picture[44, 80]) == 2, "north is on top"
    tilted = view_spec(camera, bodies={(0, 1): BodyViewSpec(texture=texture, spin=SpinSpec(period=8.0, axis=(1.0, 0.0, 0.0)))})
    assert np.argmax(draw(frame_of([0, 0, 0], 1.0), tilted, SIZE)[80, 80]) == 2, "the pole points at the viewer"


# Light and shadow


def test_share_of_a_disk_that_another_covers(cpu) -> None:
    cases = [(1.0, 0.5, 0.2), (1.0, 0.5, 0.9), (1.0, 2.0, 1.5), (0.3, 0.3, 0.4), (1.0, 0.5, 1.6), (0.01, 0.5, 0.495)]
    found = function_values(covered_share, cases)
    grid = np.linspace(-1.0, 1.0, 801)
    x, y = np.meshgrid(grid, grid)
    disk = x * x + y * y < 1.0
    expected = [((p * x - r) ** 2 + (p * y) ** 2 < q * q)[disk].mean() for p, q, r in cases]
    np.testing.assert_allclose(found, expected, atol=4.0 / 801)  # of counting squares of the grid along the edge


LIGHT_PLACE, LIGHT_RADIUS = np.array([20.0, 0.0, 20.0]), 3.0
CASTER_PLACE, CASTER_RADIUS = np.array([1.5, 0.1, 1.35]), 0.3


def _seen_of_the_light(point: np.ndarray) -> float:
    """Share of the light's sphere that is seen from a point, by rays to many points of its disk."""
    way = LIGHT_PLACE - point
    distance = np.linalg.norm(way)
    first = np.cross(way, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(way / distance, first)
    radius = np.sqrt((np.arange(4000) + 0.5) / 4000) * LIGHT_RADIUS
    angle = np.arange(4000) * math.pi * (3.0 - math.sqrt(5.0))
    target = LIGHT_PLACE + radius[:, None] * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second)
    ray = target - point
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    to_caster = CASTER_PLACE - point
    along = ray @ to_caster
    blocked = (along > 0.0) & (to_caster @ to_caster - along**2 < CASTER_RADIUS**2)
    return 1.0 - float(blocked.mean())


def test_shadow_of_a_sphere_on_a_sphere_is_that_of_rays(cpu) -> None:
    frame = frame_of([[0, 0, 0], CASTER_PLACE, LIGHT_PLACE], [1.0, CASTER_RADIUS, LIGHT_RADIUS], (0.8, 0.8, 0.8))
    bodies = {(2, 1): BodyViewSpec(light=BodyLightSpec())}
    lit = view_spec(PARALLEL, bodies=bodies, ambient=0.0)
    shaded = linear_from_srgb(draw(frame, lit, SIZE)[:, :, 1] / 255.0)
    apart = replace(frame, position=np.array([[0, 0, 0], [1.5, 9.0, 1.35], LIGHT_PLACE]))
    bright = linear_from_srgb(draw(apart, lit, SIZE)[:, :, 1] / 255.0)
    seen = set()
    for column, row in [*((column, 76) for column in range(95, 117)), *((108, row) for row in range(60, 94, 2))]:
        x, y = (column + 0.5 - 80) / 40, (80 - row - 0.5) / 40
        expected = _seen_of_the_light(np.array([x, y, math.sqrt(1.0 - x * x - y * y)]))
        # A pixel is 1/40 wide and changes by up to 0.16 within itself: its mean is by some hundredths what its middle is, where
        # the penumbra begins or ends. Displayed values are rounded to 1/255, and spheres compared as disks in a plane.
        assert shaded[row, column] / bright[row, column] == pytest.approx(expected, abs=0.03)
        seen.add(0 if expected == 0.0 else 1 if expected == 1.0 else 2)
    assert seen == {0, 1, 2}, "umbra, penumbra and light"
    assert shaded[80, 50] < 0.02 < bright[80, 105], "the far side is dark"


def test_light_from_afar_comes_from_its_direction_and_makes_shadows(cpu) -> None:
    spec = view_spec(PARALLEL, light=(LightSpec(direction=(1.0, 0.0, 0.0)),), ambient=0.0)
    alone = draw(frame_of([-0.5, 0, 0], 0.5), spec, SIZE)[:, :, 1].astype(int)
    shaded = draw(frame_of([[-0.5, 0, 0], [1.5, 0, 0]], [0.5, 0.25]), spec, SIZE)[:, :, 1].astype(int)
    assert alone[80, :59].max() == 0 and alone[80, 75] > 150 and alone[80, 82:].max() == 0, "half is lit, and nothing glows"
    # The shadow has the radius of what casts it, 0.25 around the x axis: on the sphere from x = −0.5 + √(0.5² − 0.25²) on,
    # column 77.3. At y = 0.34 there is none.
    assert alone[80, 78] > 150 and shaded[80, 78] == 0
    np.testing.assert_array_equal(shaded[80, :76], alone[80, :76])
    np.testing.assert_array_equal(shaded[66, :80], alone[66, :80])


def test_a_light_source_is_bright_without_other_light_and_has_a_glow(cpu) -> None:
    picture = draw(
        frame_of([0, 0, 0], 0.5, (1, 0.6, 0.2)), view_spec(PARALLEL, bodies={(0, 1): BodyViewSpec(light=BodyLightSpec())}), SIZE
    )
    light = linear_from_srgb(picture / 255.0).sum(axis=2)
    assert light[80, 80] > light[80, 80 + 18] > light[80, 80 + 24] > light[80, 80 + 40] > 0.0
    np.testing.assert_allclose(light[80, 80 + 24], light[80, 79 - 24], rtol=0.05)


def test_only_the_largest_spheres_cast_shadows_and_of_equal_ones_all_or_none() -> None:
    from mpp_taichi.views import surfaces

    center = np.random.default_rng(0).normal(size=(100, 3))
    size = np.full(100, 0.1)
    size[:3] = 1.0
    casters = surfaces._casters(center, size, np.ones(100, bool))
    np.testing.assert_array_equal(casters[:, 4], [0, 1, 2])
    assert len(surfaces._casters(center[:60], size[:60], np.ones(60, bool))) == 60


# Sky


def test_stars_keep_their_places_in_the_sky() -> None:
    frame = frame_of([0, 0, 0], 1.0)
    camera = Camera(FRONT, frame, aspect=1.0)
    black = np.zeros(3)

    def light_of(sky: Sky) -> np.ndarray:
        return linear_from_srgb(sky.picture(camera) / 255.0)

    light = light_of(Sky(SkySpec(stars=2000, seed=1), SIZE, black))
    np.testing.assert_array_equal(light, light_of(Sky(SkySpec(stars=2000, seed=1), SIZE, black)))
    assert (light != light_of(Sky(SkySpec(stars=2000, seed=2), SIZE, black))).any()
    camera.zoom(3.0)
    camera.pan(0.2, 0.1)
    sky = Sky(SkySpec(stars=2000, seed=1), SIZE, black)
    np.testing.assert_array_equal(light, light_of(sky), err_msg="stars are far: moving along changes nothing")
    row, column = np.unravel_index(np.argmax(light[70:90, 30:-30].sum(axis=2)), (20, 100))
    angle = 0.05
    camera.rotate(angle / math.pi, 0.0)  # to look farther to the right by so much
    focal = SIZE[1] / 2 / math.tan(math.radians(22.5))
    expected = 80 + focal * math.tan(math.atan((column + 30.5 - 80) / focal) - angle)
    near = light_of(sky)[row + 68 : row + 73, int(expected) - 2 : int(expected) + 3].sum(axis=2)
    assert near.max() > 0.5 * light[row + 70, column + 30].sum()


def test_a_picture_of_the_sky_surrounds_the_scene(cpu, tmp_path) -> None:
    sky = SkySpec(file=_globe(tmp_path))
    for position, color in (((0, -10, 0), 1), ((0, 10, 0), 0), ((0, 0.1, -10), 2)):  # looking to +y, to −y, to +z
        camera = CameraSpec(position=position, look_at=(0, 0, 0), up=(0, 0, 1))
        picture = draw(frame_of([9, 9, 9], 1e-3), view_spec(camera, sky=sky, minimum_pixels=0.0), SIZE)
        assert np.argmax(picture[80, 80]) == color and picture[80, 80].max() > 250


# Arrows, axes, grid


def test_an_arrow_ends_where_its_particle_would_be(cpu) -> None:
    frame = frame_of([[-1, 0, 0], [1, 1, 0]], 1e-3, velocity=np.array([[0.5, 0, 0], [0, 0, 0]]))
    arrows = (ArrowsSpec(time=2.0, color=(0, 1, 0), of=((0, 1),)),)
    picture = draw(frame, view_spec(PARALLEL, arrows=arrows, minimum_pixels=0.0, legend=False), SIZE)
    rows, columns = np.nonzero(picture[:, :, 1] > 60)
    # From x = −1 to 0 at 40 pixels a length; half a line's width and a pixel.
    assert columns.min() == pytest.approx(40, abs=2) and columns.max() == pytest.approx(80, abs=2)
    assert rows.mean() == pytest.approx(80, abs=1.5)
    look = Appearance(view_spec(arrows=arrows))
    look.segments(frame, Camera(PARALLEL, frame, aspect=1.0))
    assert legend_lines(look.legend()) == ["arrows: velocity × 2"]


def test_axes_and_grid_are_where_they_should_be(cpu) -> None:
    spec = view_spec(PARALLEL, axes=AxesSpec(origin=(-1, -1, 0), length=1.0), legend=False)
    picture = draw(frame_of([0, 0, 9], 1e-3), replace(spec, minimum_pixels=0.0), SIZE).astype(int)
    assert np.argmax(picture[120, 60]) == 0 and np.argmax(picture[100, 40]) == 1, "x is red and to the right, y green and up"
    assert picture[120, 90].max() == 0 and picture[70, 40].max() == 0, "and no longer than said"
    spec = view_spec(PARALLEL, grid=GridSpec(spacing=0.5, lines=2), legend=False, minimum_pixels=0.0)
    picture = draw(frame_of([0, 0, 9], 1e-3), spec, (720, 720)).max(axis=2)
    lines = np.nonzero(picture[400] > 20)[0] + 0.5
    np.testing.assert_allclose(np.unique(np.round((lines - 360) / 90, 1)), [-2, -1, 0, 1, 2], err_msg="180 pixels a length")


def test_a_legend_is_written_into_the_lower_left_corner(cpu) -> None:
    frame = frame_of([0, 0, 0], 0.01, velocity=np.ones((1, 3)))
    spec = view_spec(PARALLEL, color_by=ColorBySpec(speed=ColorScaleSpec(range=(0.0, 2.0))))
    written, bare = draw(frame, spec, (320, 180)), draw(frame, replace(spec, legend=False), (320, 180))
    rows, columns = np.nonzero((written != bare).any(axis=2))
    assert len(rows) > 300 and rows.min() > 110 and columns.max() < 160
    assert BLACK == tuple(bare[0, 0] / 255.0)


def test_writing_is_dark_on_a_light_background(cpu) -> None:
    frame = frame_of([0, 0, 0], 0.01, title="Title", velocity=np.ones((1, 3)))
    spec = view_spec(PARALLEL, caption=True, arrows=(ArrowsSpec(time=1.0),))
    for background, dark in (((1.0, 1.0, 1.0), True), (BLACK, False)):
        picture = draw(frame, replace(spec, background=background), (320, 180)).astype(int)
        for corner in (picture[:30, :40], picture[150:, :40]):
            change = (corner - picture[90, 5]).ravel()
            strongest = change[np.argmax(np.abs(change))]
            assert strongest < -150 if dark else strongest > 150


# Last, since it starts a runtime of its own


def test_only_what_a_view_asks_for_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    from mpp_taichi.views import _pixel_light, _pixels

    def not_here(*_: object) -> None:
        raise AssertionError("compiled")

    for module, name in ((_pixel_light, "shade_surface"), (_pixel_light, "glow"), (_pixels, "dither")):
        monkeypatch.setattr(module, name, not_here)
    backends.start("cpu", "f32")
    try:
        asked = view_spec(
            color_by=ColorBySpec(index=ColorScaleSpec()), arrows=(ArrowsSpec(),), axes=AxesSpec(), grid=GridSpec()
        )
        assert draw(frame_of([0, 0, 0], 1.0, velocity=np.ones((1, 3))), asked, SIZE).max() > 0
        with pytest.raises(Exception, match="compiled"):
            draw(frame_of([0, 0, 0], 1.0), view_spec(bodies={(0, 1): BodyViewSpec(light=BodyLightSpec())}), SIZE)
    finally:
        backends.stop()
