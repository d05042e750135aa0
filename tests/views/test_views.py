"""Pictures: positions, sizes and hidden parts; the same twice, on every backend and at every scale."""

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pictures import FRONT, SIZE, crowd, draw, frame_of, view_spec

from mpp_taichi.device import backends
from mpp_taichi.errors import BackendError
from mpp_taichi.plots.fonts import font_of
from mpp_taichi.scene.spec import CameraSpec, ViewSpec
from mpp_taichi.scene.view_spec import ArrowsSpec, AxesSpec, BodyLightSpec, BodyViewSpec, GridSpec, SkySpec, TextureSpec
from mpp_taichi.views import _primitives
from mpp_taichi.views.offscreen import open_offscreen
from mpp_taichi.views.trails import Trails

PARALLEL = replace(FRONT, projection="orthographic", height=8.0)


@pytest.fixture
def cpu():
    """The CPU backend in single precision."""
    return backends.start("cpu", "f32")


def silhouette(picture: np.ndarray) -> tuple[float, float, float, float]:
    """Middle (column, row) and size (width, height) of what is not black, in pixels."""
    rows, columns = np.nonzero(picture.max(axis=2) > 20)
    return (columns.min() + columns.max() + 1) / 2, (rows.min() + rows.max() + 1) / 2, np.ptp(columns) + 1, np.ptp(rows) + 1


FOCAL = SIZE[1] / 2 / math.tan(math.radians(22.5))  # pixels, 45° high


@pytest.mark.sampled(2)
@pytest.mark.parametrize("place", [(0, 0, 0), (3, 1, 0), (-2, -1, 3), (3, 0, -50)])
def test_sphere_is_drawn_where_and_as_large_as_it_is(cpu, place: tuple) -> None:
    depth, radius = 10.0 - place[2], 1.0
    column, row, width, height = silhouette(draw(frame_of(place, radius)))

    def edges(side: float) -> tuple[float, float]:  # the two tangents from the eye, in the plane of one axis and the depth
        middle, half = math.atan2(side, depth), math.asin(radius / math.hypot(side, depth))
        return FOCAL * math.tan(middle - half), FOCAL * math.tan(middle + half)

    (left, right), (bottom, top) = edges(place[0]), edges(place[1])
    assert column == pytest.approx(SIZE[0] / 2 + (left + right) / 2, abs=0.8)
    assert row == pytest.approx(SIZE[1] / 2 - (bottom + top) / 2, abs=0.8)
    assert (width, height) == (pytest.approx(right - left, abs=1.6), pytest.approx(top - bottom, abs=1.6))


@pytest.mark.parametrize("place", [(0, 0, 0), (3, 1, 0), (-2, -2, 5)])
def test_sphere_in_parallel_projection(cpu, place: tuple) -> None:
    per_length = SIZE[1] / 8.0
    column, row, width, height = silhouette(draw(frame_of(place, 1.0), view_spec(PARALLEL)))
    assert column == pytest.approx(SIZE[0] / 2 + per_length * place[0], abs=0.8)
    assert row == pytest.approx(SIZE[1] / 2 - per_length * place[1], abs=0.8)
    assert width == pytest.approx(2 * per_length, abs=1.6) and height == pytest.approx(2 * per_length, abs=1.6)


@pytest.mark.parametrize("camera", [FRONT, PARALLEL])
def test_nearer_sphere_hides_the_farther(cpu, camera: CameraSpec) -> None:
    red, green = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    for order in (1, -1):
        picture = draw(frame_of([[0, 0, 0], [0, 0, 2]][::order], 1.0, [red, green][::order]), view_spec(camera))
        middle = picture[SIZE[1] // 2, SIZE[0] // 2].astype(int)
        assert middle[1] > 2 * middle[0]


def test_spheres_that_cross_meet_in_a_plane(cpu) -> None:
    picture = draw(frame_of([[-0.6, 0, 0], [0.6, 0, 0]], 1.0, [(1, 0, 0), (0, 0, 1)]), view_spec(PARALLEL)).astype(int)
    red = picture[:, :, 0] > picture[:, :, 2]
    lit = picture.max(axis=2) > 20
    assert red[:, : SIZE[0] // 2 - 1][lit[:, : SIZE[0] // 2 - 1]].all()
    assert not red[:, SIZE[0] // 2 + 1 :][lit[:, SIZE[0] // 2 + 1 :]].any()


def test_light_comes_from_the_upper_left(cpu) -> None:
    picture = draw(frame_of([0, 0, 0], 2.0)).astype(float).sum(axis=2)
    row, column = np.unravel_index(np.argmax(picture), picture.shape)
    assert row < SIZE[1] / 2 - 5 and column < SIZE[0] / 2 - 5
    assert picture[SIZE[1] // 2 - 20, SIZE[0] // 2 - 20] > picture[SIZE[1] // 2 + 20, SIZE[0] // 2 + 20] > 0


def test_edges_are_smooth(cpu) -> None:
    picture = draw(frame_of([0, 0, 0], 2.0, (0.0, 0.0, 0.0)), view_spec(background=(1.0, 1.0, 1.0)))
    values = np.unique(picture[SIZE[1] // 2 - 30 : SIZE[1] // 2, :, 0])
    assert len([value for value in values if 120 < value < 254]) >= 3, "pixels a quarter, half and three quarters covered"


def test_background_is_exact(cpu) -> None:
    picture = draw(frame_of([0, 0, 0], 0.1), view_spec(background=(0.2, 0.4, 0.6)))
    np.testing.assert_array_equal(picture[0, 0], (51, 102, 153))


def test_small_spheres_do_not_vanish(cpu) -> None:
    places = [[x, y, 0] for x in (-3.03, 0.01, 2.57) for y in (-1.51, 0.02, 1.77)]
    picture = draw(frame_of(places, 1e-9), view_spec(minimum_pixels=1.5))
    lit = picture.max(axis=2) > 20
    assert 9 * 4 <= lit.sum() <= 9 * 16


def test_spring_is_seen_between_spheres_and_not_through_them(cpu) -> None:
    ends = frame_of(
        [[-3, 0, 0], [3, 0, 0], [0, 0, 0]],
        [0.2, 0.2, 1.0],
        (1, 0, 0),
        between=np.array([[0, 1]]),
        spring_color=np.array([[0, 1.0, 0]]),
    )
    picture = draw(ends, view_spec(spring_width=16.0)).astype(int)
    row = SIZE[1] // 2
    green = picture[:, :, 1] > picture[:, :, 0]
    assert green[row, SIZE[0] // 2 - int(FOCAL * 0.2)] and not green[row, SIZE[0] // 2]
    column = SIZE[0] // 2 - int(FOCAL * 0.2)
    assert green[:, column].sum() == pytest.approx(16.0 * SIZE[1] / 720, abs=1.1), "width is given for a picture 720 high"


def test_spring_that_passes_the_camera(cpu) -> None:
    ends = frame_of([[0, -1, 0], [0.0, -1, 40]], 1e-6, between=np.array([[0, 1]]), spring_color=np.ones((1, 3)))
    lit = draw(ends, view_spec(spring_width=8.0)).max(axis=2) > 20
    assert lit[SIZE[1] - 1, SIZE[0] // 2] and not lit[: SIZE[1] // 2].any()
    behind = replace(ends, position=np.array([[-5, 0, 11.0], [5, 0, 12]]))
    assert draw(behind, view_spec(spring_width=8.0)).max() == 0


@pytest.mark.sampled(3)
@pytest.mark.parametrize("size", [SIZE, (321, 177), (16, 16), (5, 3), (1, 1)])
@pytest.mark.parametrize("camera", [FRONT, PARALLEL])
def test_tiles_change_nothing(cpu, monkeypatch: pytest.MonkeyPatch, size: tuple[int, int], camera: CameraSpec) -> None:
    from mpp_taichi.views import renderer

    spec = view_spec(camera, spring_width=6.0)
    tiled = draw(crowd(), spec, size)
    binned = _primitives.bin_into_tiles

    def everything_everywhere(spheres: np.ndarray, lines: np.ndarray, screen: _primitives.Screen) -> _primitives.Primitives:
        drawn = binned(spheres, lines, screen)
        tiles, count = screen.tiles_across * screen.tiles_down, len(drawn.table)
        table = drawn.table.copy()
        table[:, 0], table[:, 1], table[:, 2], table[:, 3] = -1e9, 1e9, -1e9, 1e9
        entry = np.tile(np.argsort(table[:, 4], kind="stable"), tiles).astype(np.int32)
        table[:, 4] = -1e9  # no early end
        return _primitives.Primitives(table, drawn.sphere_count, np.arange(tiles + 1, dtype=np.int32) * count, entry)

    monkeypatch.setattr(renderer, "bin_into_tiles", everything_everywhere)
    np.testing.assert_array_equal(draw(crowd(), spec, size), tiled)


@pytest.mark.parametrize("camera", [FRONT, PARALLEL])
@pytest.mark.sampled(3)
def test_tiles_that_look_for_their_primitives_show_what_pixels_do(cpu, monkeypatch: pytest.MonkeyPatch, camera) -> None:
    """CPUs go through a tile's primitives once, GPUs for each pixel: the same to the last bit, also where a sun glows."""
    from mpp_taichi.views import renderer

    sun = {(0, 1): BodyViewSpec(light=BodyLightSpec(), radius_scale=4.0)}
    specs = [view_spec(camera, spring_width=6.0), view_spec(camera, bodies=sun, sky=SkySpec(stars=100))]
    pictures = []
    for by_tile in (True, False):
        monkeypatch.setattr(renderer, "on_cpu", lambda by_tile=by_tile: by_tile)
        pictures.append([draw(crowd(), spec, (321, 177)) for spec in specs])
    for ours, theirs in zip(*pictures, strict=True):
        assert ours.max() > 100
        np.testing.assert_array_equal(ours, theirs)


def test_picture_repeats_and_does_not_depend_on_the_order(cpu) -> None:
    frame = crowd()
    first = draw(frame)
    np.testing.assert_array_equal(draw(frame), first)
    order = np.random.default_rng(0).permutation(len(frame.position))
    place = np.argsort(order)
    shuffled = replace(
        frame,
        position=frame.position[order],
        radius=frame.radius[order],
        color=frame.color[order],
        between=place[frame.between],
    )
    np.testing.assert_array_equal(draw(shuffled), first)


@pytest.mark.parametrize("scale", [1.5e11, 1e-10])
def test_scale_and_place_change_nothing(cpu, scale: float) -> None:
    shift = np.array([5.0, -7.0, 3.0])
    frame = crowd()
    moved = replace(frame, position=(frame.position + shift) * scale, radius=frame.radius * scale)
    camera = replace(FRONT, position=tuple((np.array(FRONT.position) + shift) * scale), look_at=tuple(shift * scale))
    difference = np.abs(draw(moved, view_spec(camera)).astype(int) - draw(frame).astype(int)).max(axis=2)
    assert (difference > 3).mean() < 1e-3


def test_double_precision_of_the_simulation_changes_nothing() -> None:
    pictures = []
    for precision in ("f32", "f64"):
        backends.start("cpu", precision)
        pictures.append(draw(crowd()))
        backends.stop()
    np.testing.assert_array_equal(*pictures)


@pytest.mark.sampled(3)
def test_vulkan_draws_the_same(software_vulkan) -> None:
    texture = TextureSpec(pattern="checker")
    bodies = {
        (0, 1): BodyViewSpec(light=BodyLightSpec(), radius_scale=4.0),
        (1, 200): BodyViewSpec(texture=texture, radius_scale=2.0),
    }
    views = (view_spec(), view_spec(bodies=bodies, sky=SkySpec(stars=500)))
    pictures = []
    for backend in ("cpu", "vulkan"):
        backends.start(backend, "f32")
        pictures.append([draw(crowd(), spec).astype(int) for spec in views])
        backends.stop()
    for ours, theirs in zip(*pictures, strict=True):
        assert (np.abs(ours - theirs).max(axis=2) > 3).mean() < 1e-3


def test_bad_numbers_are_left_out(cpu) -> None:
    frame = frame_of(
        [[0, 0, 0], [np.nan, 0, 0], [np.inf, 1, 1], [1e300, 0, 0], [0, 0, 10]],
        [1, 1, 1, 1, 1],
        between=np.array([[0, 1], [2, 3]]),
        spring_color=np.ones((2, 3)),
    )
    np.testing.assert_array_equal(draw(frame), draw(frame_of([0, 0, 0], 1.0)))


def test_nothing_to_draw(cpu) -> None:
    assert draw(frame_of([], 0.1), view_spec(CameraSpec())).max() == 0


def test_particles_may_come_and_go(cpu) -> None:
    view = open_offscreen(view_spec(trails=5), SIZE)
    for index, count in enumerate((3, 3, 2, 0, 5)):
        view.draw(
            replace(
                crowd(40),
                position=crowd(40).position[:count],
                radius=crowd(40).radius[:count],
                color=crowd(40).color[:count],
                between=np.zeros((0, 2), int),
                spring_color=np.zeros((0, 3)),
                time=float(index),
            )
        )


# Trails and captions


def test_trail_follows_and_fades(cpu) -> None:
    view = open_offscreen(view_spec(trails=10, spring_width=6.0), SIZE)
    for index in range(30):
        picture = view.draw(frame_of([-3 + 0.2 * index, 0, 0], 0.05, time=0.1 * index))
    row = picture[SIZE[1] // 2 - 1 : SIZE[1] // 2 + 1].max(axis=(0, 2)).astype(int)
    head = int(SIZE[0] / 2 + FOCAL * 0.28)
    tail = int(SIZE[0] / 2 + FOCAL * 0.08)
    assert row[tail - 12 : tail - 4].max() == 0, "older positions are forgotten"
    assert row[tail + 6] < row[(head + tail) // 2] < row[head - 4]


@pytest.mark.parametrize("camera", [FRONT, PARALLEL], ids=lambda camera: camera.projection)
def test_where_a_path_is_gone_again_its_newest_part_is_seen(cpu, camera) -> None:
    view = open_offscreen(view_spec(camera, trails=40), SIZE)
    for index, place in enumerate([*np.linspace(-3, 3, 25), *np.linspace(3, 0, 12)[1:]]):
        picture = view.draw(frame_of([place, 0, 0], 0.01, time=float(index)))
    scale = FOCAL / 10 if camera is FRONT else SIZE[1] / 8
    row = picture[SIZE[1] // 2 - 2 : SIZE[1] // 2 + 2].max(axis=(0, 2)).astype(int)
    twice = row[
        SIZE[0] // 2 + 12 : int(SIZE[0] / 2 + 2.8 * scale)
    ]  # the newest part fades to the right, the older one to the left
    assert twice.min() > 0 and np.diff(twice).max() <= 0 and np.ptp(twice) > 10


def test_trails_wait_and_start_afresh() -> None:
    trails = Trails(4)
    for time in (0.0, 1.0, 1.0, 1.0, 2.0):
        trails.add(frame_of([time, 0, 0], 0.1, time=time))
    assert len(trails.segments(np.ones((1, 3)), np.zeros(3))[0]) == 2
    trails.add(frame_of([0, 0, 0], 0.1, time=0.0))
    assert len(trails.segments(np.ones((1, 3)), np.zeros(3))[0]) == 0


@pytest.mark.parametrize("size", [(1280, 720), (160, 90), (20, 10)])
def test_caption_is_written(cpu, size: tuple[int, int]) -> None:
    frame = frame_of([0, 0, 0], 1e-9, title="Drei Körper – Šídlo", time=12.5, extra="ΔE/E = 1e-9")
    plain, written = draw(frame, view_spec(), size), draw(frame, view_spec(caption=True), size)
    rows, columns = np.nonzero((plain != written).any(axis=2))
    assert len(rows) > 20
    assert rows.max() < max(size[1] / 6, 10) + 30 and columns.min() < 20


def test_caption_has_letters_of_many_languages() -> None:
    font = font_of(20)
    missing = font.getmask("\uffff").tobytes() if hasattr(font.getmask("x"), "tobytes") else bytes(font.getmask("\uffff"))
    for letter in "äößéñŠůŁĞαΔπЖя–²·":
        assert bytes(font.getmask(letter)) != bytes(missing), letter


def test_views_that_only_describe_start_nothing() -> None:
    modules = ("camera", "caption", "offscreen", "controls", "appearance", "legend", "sky", "surfaces")
    code = "import sys, " + ", ".join(f"mpp_taichi.views.{name}" for name in modules) + "; sys.exit('taichi' in sys.modules)"
    assert (
        subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}).returncode
        == 0
    )


# Choosing a renderer


def test_unknown_renderer_is_refused() -> None:
    with pytest.raises(ValueError, match="none of own, ggui"):
        open_offscreen(ViewSpec(), SIZE, renderer="opengl")


def test_missing_vulkan_is_said(cpu, monkeypatch: pytest.MonkeyPatch) -> None:
    from mpp_taichi.views import ggui_probe

    monkeypatch.setattr(ggui_probe, "PROBE", "import os; os.abort()")
    ggui_probe.probe.cache_clear()
    try:
        with pytest.raises(BackendError, match="cannot draw with GGUI"):
            open_offscreen(ViewSpec(), SIZE, renderer="ggui")
    finally:
        ggui_probe.probe.cache_clear()


@pytest.fixture
def ggui_works(cpu):
    """Skip where GGUI cannot draw without a window."""
    from mpp_taichi.views.ggui_probe import probe

    if problem := probe(shown=False):
        pytest.skip(problem)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("camera", [FRONT, PARALLEL], ids=["perspective", "parallel"])
@pytest.mark.parametrize("size", [SIZE, (200, 200), (150, 240)])
def test_ggui_draws_the_same_shapes(ggui_works, camera: CameraSpec, size: tuple[int, int]) -> None:
    frame = frame_of(
        [[0, 0, 0], [2, 1, 1], [-1.5, -2, -3], [1, -1, 4]],
        [0.8, 0.4, 0.9, 0.3],
        (1, 1, 1),
        between=np.array([[0, 1], [0, 2]]),
        spring_color=np.ones((2, 3)),
    )
    spec = view_spec(camera, spring_width=20.0)
    ours, theirs = (draw(frame, spec, size, name).max(axis=2) > 20 for name in ("own", "ggui"))
    assert (ours & theirs).sum() / (ours | theirs).sum() > 0.93


CAMERAS = {
    "perspective": FRONT,
    "oblique": CameraSpec(position=(6.0, -7.0, 4.0), look_at=(0.5, 0.0, -0.5), up=(0.2, 0.1, 1.0), field_of_view=60.0),
    "far away": CameraSpec(position=(0.0, -440.0, 99.0), look_at=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), field_of_view=1.2),
    "parallel": PARALLEL,
    "parallel, oblique": replace(PARALLEL, position=(5.0, 3.0, -4.0), look_at=(0.0, 0.5, 0.0), height=13.0),
}


def pinhole(camera: CameraSpec, place: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Column and row at which a pinhole camera, or one without perspective, shows places; shape (count, 2)."""
    eye = np.array(camera.position)
    ahead = np.array(camera.look_at) - eye
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    way = place - eye
    across = np.stack([way @ right, -(way @ np.cross(right, ahead))], axis=1)
    if camera.projection == "orthographic":
        return np.array(size) / 2 + size[1] / camera.height * across
    focal = size[1] / 2 / math.tan(math.radians(camera.field_of_view) / 2)
    return np.array(size) / 2 + focal * across / (way @ ahead)[:, None]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_every_particle_is_at_its_pixel_in_both_renderers(ggui_works, camera: CameraSpec) -> None:
    size, reach = (640, 360), 11
    place = np.random.default_rng(2).uniform(-4.0, 4.0, (200, 3))
    pixel = pinhole(camera, place, size)
    apart, kept = [], []
    for number, each in enumerate(pixel):  # those that stand alone in the picture
        inside = (each > 2 * reach).all() and (each < np.array(size) - 2 * reach).all()
        if inside and all(np.abs(each - other).max() > 2 * reach + 2 for other in apart):
            apart.append(each)
            kept.append(number)
    assert len(kept) > 30
    spec = view_spec(camera, minimum_pixels=5.0)  # all 5 pixels in radius: bodies as small as these are as good as points
    for renderer in ("own", "ggui"):
        picture = draw(frame_of(place[kept], 1e-4), spec, size, renderer).max(axis=2) > 0
        assert silhouette(255 * np.repeat(picture[:, :, None], 3, axis=2))[2] > 100
        for column, row in apart:
            left, top = int(column) - reach, int(row) - reach
            rows, columns = np.nonzero(picture[top : top + 2 * reach, left : left + 2 * reach])
            found = np.array([left + columns.mean() + 0.5, top + rows.mean() + 0.5])
            assert np.abs(found - (column, row)).max() < 1.0, (renderer, column, row, found)


def test_ggui_draws_what_is_added_to_a_scene(ggui_works) -> None:
    moving = frame_of([[-1, 0, 0], [2, 1, 0]], 0.2, velocity=np.array([[1.0, 0.5, 0], [0, -1, 0]]), time=1.0)
    outline = np.array([[[-3, -1.5, 0], [3, -1.5, 0]], [[3, -1.5, 0], [3, 1.5, 0]]], dtype=float)
    asked = {"arrows": (ArrowsSpec(time=1.5),), "axes": AxesSpec(length=1.0), "grid": GridSpec(spacing=1.0, lines=2)}
    spec = view_spec(FRONT, trails=5, spring_width=20.0, legend=False, **asked)
    pictures = []
    for renderer in ("own", "ggui"):
        view = open_offscreen(spec, (640, 360), renderer=renderer)
        view.draw(replace(moving, position=moving.position - moving.velocity, time=0.0, outline=outline))
        pictures.append(view.draw(replace(moving, outline=outline)).max(axis=2) > 20)
        view.close()
    # Edges and widths of thin lines differ by a pixel; a wall, the trail, arrows, axes or the grid are more than a tenth each.
    for picture, other in (pictures, pictures[::-1]):
        wider = np.max([np.roll(other, (down, across), (0, 1)) for down in (-1, 0, 1) for across in (-1, 0, 1)], axis=0)
        assert (picture & wider).sum() / picture.sum() > 0.95


def test_ggui_forgets_the_last_frame_and_leaves_no_file(ggui_works, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    view = open_offscreen(view_spec(), SIZE, renderer="ggui")
    view.draw(frame_of([-3, 0, 0], 0.5))
    column, _, width, _ = silhouette(view.draw(frame_of([3, 0, 0], 0.5)))
    view.close()
    view.close()
    assert list(tmp_path.iterdir()) == [], "the panel library of GGUI would write its layout here"
    assert column > SIZE[0] / 2 and width < SIZE[0] / 4
