"""Names beside bodies and the scale bar: where they are drawn, which are left out, and that they stay readable."""

from dataclasses import replace

import numpy as np
import pytest
from pictures import FRONT, frame_of, view_spec

from mpp_taichi.device import backends
from mpp_taichi.errors import SceneError
from mpp_taichi.plots.fonts import font_of
from mpp_taichi.scene.load import load_scene
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.labels import name_tags
from mpp_taichi.views.overlay import draw_overlay, overlay_layer
from mpp_taichi.views.renderer import Renderer
from mpp_taichi.views.scale_bar import ScaleBar

SIZE, LETTERS = (640, 360), 16
FLAT = replace(FRONT, projection="orthographic", height=8.0)
PIXEL = 8.0 / 360  # length


@pytest.fixture(autouse=True)
def fresh_runtime():
    """Not after each test here: one picture needs a runtime, and begins it."""
    return


def tags_of(places, radii, names, camera=FLAT, labels=True, size=SIZE):
    """The names of bodies in a picture, by their text."""
    frame, spec = frame_of(places, radii, name=tuple(names)), view_spec(camera, labels=labels)
    return {tag.text: tag for tag in name_tags(frame, spec, Camera(camera, frame, aspect=size[0] / size[1]), size, LETTERS)}


def test_a_name_stands_beside_its_body_by_the_drawn_radius() -> None:
    for radius in (0.1, 0.8):
        tag = tags_of([[1.0, -2.0, 0.0]], [radius], ["earth"])["earth"]
        assert tag.middle == pytest.approx(180 + 2.0 / PIXEL)
        assert 0 < tag.left - (320 + (1.0 + radius) / PIXEL) < LETTERS


def test_a_name_that_would_leave_the_picture_stands_on_the_left() -> None:
    tag = tags_of([[6.9, 0.0, 0.0]], [0.1], ["callisto"])["callisto"]
    assert tag.box[2] < 320 + 6.8 / PIXEL and tag.box[0] > 0


def test_names_behind_the_camera_outside_and_behind_bodies_are_left_out() -> None:
    places = [[0, 0, 0], [0.1, 0, -3], [0, 0, 20], [30, 0, 0], [0, 3, -3], [np.nan] * 3]
    found = tags_of(places, [1.0, 0.2, 0.5, 0.5, 0.2, 0.2], ["sun", "hidden", "behind", "outside", "free", "gone"], FRONT)
    assert set(found) == {"sun", "free"}


def test_of_two_names_in_one_place_the_nearer_body_has_its_own() -> None:
    places, radii = [[0, 0, 0], [0.1, 0.1, 1.0], [0, -2, -1]], [0.1, 0.1, 0.1]
    assert set(tags_of(places, radii, ["far", "near", "apart"], FRONT)) == {"near", "apart"}
    boxes = [tag.box for tag in tags_of(np.random.default_rng(3).normal(size=(80, 3)), [0.05] * 80, ["name"] * 80).values()]
    many = frame_of(np.random.default_rng(3).normal(size=(80, 3)), 0.05, name=("name",) * 80)
    tags = name_tags(many, view_spec(FLAT, labels=True), Camera(FLAT, many, aspect=16 / 9), SIZE, LETTERS)
    assert boxes and 10 < len(tags) < 80
    for n, one in enumerate(tags):
        for other in tags[:n]:
            a, b = one.box, other.box
            assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


def test_only_the_bodies_that_are_asked_for_have_names_and_a_group_has_one() -> None:
    places = [[-2, 0, 0], [2, 0, 0], [2, 2, 0]]
    found = tags_of(places, [0.1] * 3, ["a", "", ""], labels=(("ring", 1, 2),))
    assert set(found) == {"ring"} and found["ring"].middle == pytest.approx(180 - 1.0 / PIXEL)


def test_the_picture_has_letters_beside_the_projected_body_and_nowhere_else() -> None:
    backends.start("cpu", "f32")
    try:
        places = [[-3.0, 1.0, 0.0], [3.0, -1.0, 2.0]]
        frame = frame_of(places, [0.3, 0.2], (0.2, 0.4, 1.0), name=("Überß Ωж", "earth"))
        spec = view_spec(FRONT)
        plain = Renderer(spec, SIZE).draw(frame)
        named = Renderer(replace(spec, labels=True), SIZE).draw(frame)
    finally:
        backends.stop()
    changed = (plain != named).any(axis=2)
    camera = Camera(FRONT, frame, aspect=16 / 9)
    expected = name_tags(frame, replace(spec, labels=True), camera, SIZE, letters=9)
    rest = changed.copy()
    for tag, place in zip(sorted(expected, key=lambda each: each.left), places, strict=True):
        right, up, depth = camera.view(np.array(place))
        per_pixel = float(camera.length_per_pixel(np.array(depth), SIZE[1]))
        assert tag.middle == pytest.approx(180 - up / per_pixel)
        left, top, far, low = (round(edge) for edge in tag.box)
        assert named[top:low, left : far + 3].max() >= 220, "letters are bright"
        assert left > 320 + right / per_pixel
        rest[top - 2 : low + 3, left - 3 : far + 4] = False
    assert changed.sum() > 200 and not rest.any()


def test_letters_beyond_ascii_differ_from_the_sign_of_a_missing_letter() -> None:
    font = font_of(20)
    missing = np.asarray(font.getmask("\U0001f30d"))
    for letter in "äéßğΩжЯ":
        shape = np.asarray(font.getmask(letter))
        assert len(shape) != len(missing) or (shape != missing).any()


def test_names_are_readable_on_white_and_on_black() -> None:
    """The outline has the colour that the letters do not have, so that letters are seen before anything."""
    frame = frame_of([[0, 0, 0]], 0.1, name=("earth",))
    spec = view_spec(FLAT, labels=True)
    for ground in (0, 255):
        picture = np.full((360, 640, 3), ground, np.uint8)
        draw_overlay(picture, frame, spec, Camera(FLAT, frame, aspect=16 / 9))
        part = picture[165:195, 320:400]
        assert part.min() < 60 and part.max() > 200


def test_a_window_has_the_pixels_of_the_film() -> None:
    frame, spec = frame_of([[0, 0, 0]], 0.1, name=("earth",)), view_spec(FLAT, labels=True, scale_bar=True)
    camera, picture = Camera(FLAT, frame, aspect=16 / 9), np.zeros((360, 640, 3), np.uint8)
    draw_overlay(picture, frame, spec, camera)
    rows, columns, colors = overlay_layer(frame, spec, camera, SIZE, (0.0, 0.0), SIZE)
    layer = np.zeros_like(picture)
    layer[rows, columns] = colors
    bright = picture.min(axis=2) > 180
    assert bright.sum() > 100 and (layer[bright] > 120).all()


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("units", "height", "text"),
    [
        (None, 8.0, "2"),
        ({"length": "AU"}, 8.0, "2 AU"),
        ({"length": "m"}, 4e9, "1,000,000 km"),
        ({"length": "m"}, 4e11, "1 AU"),
        ({"length": "km"}, 9e5, "200,000 km"),
        ({"length": "m"}, 8e-6, "2 µm"),
        ({"length": "AU"}, 1e7, "20 pc"),
    ],
)
def test_the_scale_bar_has_a_round_length_that_is_easy_to_read(units, height, text) -> None:
    """2 of a height of 8 are a quarter of 360 rows."""
    spec = replace(FLAT, height=height)
    bar = ScaleBar.of(Camera(spec, frame_of([[0, 0, 0]], 0.1), aspect=16 / 9), SIZE, units)
    assert bar.text == text
    assert 0.1 * 640 < bar.pixels < 0.3 * 640
    if height == 8.0:
        assert bar.pixels == pytest.approx(2.0 / PIXEL)


SCENE = {
    "particles": [
        {"body": {"name": "sun", "mass": 1.0, "position": [0, 0, 0]}},
        {"body": {"name": "earth", "mass": 1.0, "position": [1, 0, 0]}},
    ],
    "integrator": {"leapfrog": {"dt": 0.1}},
    "run": {"duration": 1.0},
}


def test_a_name_that_no_body_has_is_refused_in_its_place() -> None:
    assert load_scene(SCENE | {"view": {"labels": ["earth", 0]}}).view.labels == (("earth", 1, 1), ("sun", 0, 1))
    assert load_scene(SCENE | {"view": {"labels": True}}).view.labels is True
    assert not load_scene(SCENE | {"view": {"labels": False}}).view.labels
    with pytest.raises(SceneError, match=r"view\.labels\[1\].*no particle is called 'eart', did you mean 'earth'"):
        load_scene(SCENE | {"view": {"labels": ["sun", "eart"]}})
    with pytest.raises(SceneError, match=r"view\.labels"):
        load_scene(SCENE | {"view": {"labels": "earth"}})
