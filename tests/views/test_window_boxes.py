"""Parts of the window without a display: its division, its boxes, its looks, and trails of many particles."""

import numpy as np
import pytest
from pictures import frame_of

from mpp_taichi.views.few_trails import MOST_PIECES, FewTrails
from mpp_taichi.views.looks import MOST_PARTICLES, is_film
from mpp_taichi.views.method_box import MethodBox
from mpp_taichi.views.paper import GRIP, RIM, ROW, Mouse, Paper
from mpp_taichi.views.scene_list import SceneList
from mpp_taichi.views.slider_panel import Knob, SliderPanel
from mpp_taichi.views.window_boxes import WindowBoxes
from mpp_taichi.views.window_film import WindowFilm, no_film
from mpp_taichi.views.window_layout import ROOMY, Area, Layout


@pytest.mark.sampled(2)
@pytest.mark.parametrize("size", [(1280, 720), (1366, 768), ROOMY, (640, 360)])
def test_boxes_lie_beside_the_picture_where_there_is_room(size):
    covered = np.zeros(size[::-1], int)
    layout = Layout.of(size, boxes=True)
    for area in (layout.picture, layout.column, layout.strip):
        if area is not None:
            covered[area.top : area.top + area.height, area.left : area.left + area.width] += 1
    assert (covered == 1).all()
    assert (layout.column is not None) == (layout.strip is not None) == (size >= ROOMY)
    without = Layout.of(size, boxes=False)
    assert without.picture.width == size[0] and without.column is None


@pytest.mark.sampled(2)
@pytest.mark.parametrize("size", [(1, 1), (2, 50), (16, 16), (24, 40), (300, 20), (959, 2000), (1280, 720)])
def test_a_window_of_any_size_has_boxes(size):
    knob = Knob("k", "k", 0.0, 1.0, False, lambda: 0.5)
    boxes = WindowBoxes(SliderPanel([knob]), SceneList(None), MethodBox(None))
    boxes.scenes.toggle()
    boxes.begin()
    texts = {"caption": (), "legend": ("long " * 50,), "picked": ("p",), "status": ["a", "b"], "look": "as in films"}
    layout = Layout.of(size, boxes=True)
    boxes.put(layout, Mouse((3.0, 3.0), True, True), running=True, filming=False, with_help=True, **texts)
    boxes.end()
    whole = np.zeros((size[1], size[0], 3), np.uint8)
    boxes.paste(whole)
    assert whole.any() or min(size) < 20, "a box begins 8 pixels from the rims"


def test_places_in_an_area():
    area = Area(100, 20, 400, 200)
    assert area.share((100, 20)) == (0.0, 1.0) and area.share((300, 170)) == (0.5, 0.25)
    assert area.holds((100, 20)) and not area.holds((99, 20)) and not area.holds((500, 100))
    assert area.box_of(Area(300, 70, 100, 50)) == (0.5, 0.25, 0.25, 0.25)


def written(text):
    """A box with one line."""
    paper = Paper()
    paper.begin((200, 40), Mouse())
    paper.text(text)
    return paper.picture()


def test_a_box_has_letters_beyond_latin():
    pictures = [written(f"A{letter}B") for letter in "–?-λЖ ©"]
    for n, one in enumerate(pictures):
        assert not any(np.array_equal(one, other) for other in pictures[:n]), "each letter has its own form"


def test_a_line_that_is_too_long_is_cut_off_within_its_box():
    whole = written("word " * 50)
    assert whole[:, -RIM:].max() == whole[0, 0].max(), "nothing is written in the rim"
    assert (whole[:, -3 * RIM : -RIM].max(axis=2) > 150).any()
    assert not np.array_equal(whole, written("word " * 2))


def test_sliders_are_shown_and_hidden_in_turn_and_never_shown_where_there_are_none():
    with_sliders, without = SliderPanel([Knob("k", "k", 0.0, 1.0, False, lambda: 0.5)]), SliderPanel([])
    shown = [(with_sliders.shown, without.shown)]
    for _ in range(3):
        with_sliders.toggle()
        without.toggle()
        shown.append((with_sliders.shown, without.shown))
    assert shown == [(True, False), (False, False), (True, False), (False, False)]


def test_a_slider_follows_the_mouse_that_holds_it_and_a_button_is_pressed_once():
    value = [0.0]
    panel, paper = SliderPanel([Knob("k", "k", 0.0, 1.0, False, lambda: value[0])]), Paper()
    middle = RIM + ROW // 2
    for x, y, down, expected in (
        (100, 200, True, {}),  # beside it
        (100, middle, False, {}),  # not pressed
        (100, middle, True, {"k": pytest.approx((100 - RIM - GRIP / 2) / (184 - GRIP), abs=1e-6)}),
        (150, 300, False, {"k": pytest.approx((150 - RIM - GRIP / 2) / (184 - GRIP), abs=1e-6)}),  # held, below it
    ):
        paper.begin((2 * RIM + 184, 100), Mouse((x, y), down, True))
        moved = panel.draw(paper)
        assert moved == expected
        value[0] = moved.get("k", value[0])
    paper.begin((2 * RIM + 184, 100), Mouse((100, middle), False, False))
    assert panel.draw(paper) == {}, "let go"
    pressed = []
    for down in (False, True, False):
        paper.begin((200, 60), Mouse((50, middle), down, True))
        pressed.append((paper.button("one"), paper.button("two")))
    assert pressed == [(False, False), (True, False), (False, False)]
    assert paper.picture() is paper.picture(), "drawn only where it has changed"


def test_many_particles_have_a_few_fading_trails_and_a_line_says_so():
    length, count = 60, 5000
    places = np.random.default_rng(1).normal(size=(count, 3))
    colors = np.linspace(0.2, 1.0, count)[:, None] * np.ones(3)
    few = FewTrails(length)
    for n in range(length + 1):
        few.add(frame_of(places + [0.01 * n, 0, 0], 0.1, time=float(n)))
    ends, shades, age = few.segments(colors, np.zeros(3))
    assert 0.5 * MOST_PIECES < len(ends) <= MOST_PIECES
    told = len(ends) // length
    assert few.message == f"trails of {told:,} of 5,000 particles"
    oldest, newest = ends[:told], ends[-told:]
    owners = [int(np.abs(places - first).sum(axis=1).argmin()) for first in oldest[:, 0]]
    np.testing.assert_allclose(newest[:, 1] - places[owners], [[0.01 * length, 0, 0]] * told, atol=1e-12)
    np.testing.assert_allclose(shades[-told:, 1], colors[owners], atol=1e-12)
    assert (shades[:told, 0] == 0.0).all() and age[0] > 0.9 and age[-1] == 0.0, "fading from the newest to the oldest"


def test_trails_that_a_scene_asks_for_are_complete():
    everything, few = FewTrails(60, everything=True), FewTrails(60)
    for trails in (everything, few):
        for n in range(2):
            trails.add(frame_of(np.full((1000, 3), float(n)), 0.1, time=float(n)))
    assert everything.message == "" and len(everything.segments(np.ones((1000, 3)), np.zeros(3))[0]) == 1000
    assert few.message.startswith("trails of 143 of")


class Tape:
    """A film in memory."""

    def __init__(self, size, fps):
        self.path, self.size, self.fps, self.pictures, self.closed = "film.mp4", size, fps, [], False

    def write(self, picture):
        self.pictures.append(picture)

    def close(self):
        self.closed = True


def test_a_film_of_the_window_has_the_pace_in_which_it_was_seen():
    tapes = []
    film = WindowFilm(lambda size, fps: tapes.append(Tape(size, fps)) or tapes[-1])
    picture = np.zeros((21, 31, 3), np.uint8)
    assert film.add(picture, 1.0) == "" and not tapes, "off"
    assert "D" in film.toggle(None) and not film.on
    assert film.toggle(picture) == "records film.mp4" and film.on and tapes[0].size == (30, 20)
    for _ in range(60):
        film.add(picture, 1.0 / 60.0)
    assert abs(len(tapes[0].pictures) - tapes[0].fps) <= 1, "a second of the film for a second, seen at 60 pictures in a second"
    film.add(picture, 0.5)
    assert {each.shape for each in tapes[0].pictures} == {(20, 30, 3)}, "rows and columns of films are even"
    assert abs(len(tapes[0].pictures) - 1.5 * tapes[0].fps) <= 1
    assert film.toggle(picture) == "saved film.mp4" and tapes[0].closed and film.end() == ""
    film.toggle(picture)
    assert film.add(np.zeros((20, 40, 3), np.uint8), 0.1).startswith("saved") and tapes[1].closed and not film.on
    refused = WindowFilm(no_film)
    assert "no film" in refused.toggle(picture) and not refused.on


def test_the_look_is_that_of_films_up_to_a_number_of_particles():
    assert is_film("auto", MOST_PARTICLES) and not is_film("auto", MOST_PARTICLES + 1)
    assert is_film("film", 10**6) and not is_film("plain", 1)


def test_the_rectangles_of_a_box_are_those_of_its_picture():
    """Where GGUI draws the scene, a box is these rectangles and the pixels that differ from them: letters and round corners."""
    paper = Paper()
    paper.begin((200, 60), Mouse())
    paper.button("")
    picture, ground = paper.picture(), np.zeros((60, 200, 3), np.uint8)
    for (left, top, right, bottom), color in paper.grounds():
        ground[top:bottom, left:right] = color
    assert len(paper.grounds()) == 2 and 0 < (picture != ground).any(axis=2).sum() <= 4 * 9, "four corners"
