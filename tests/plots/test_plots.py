"""Plots: axes with round ticks, curves that contain every value, and files that contain every number."""

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mpp_taichi.plots import Curves, Histogram, Samples
from mpp_taichi.plots.axis import Axis
from mpp_taichi.plots.cursor import read
from mpp_taichi.plots.frame import PanelFrame, fitting_axes
from mpp_taichi.plots.map import Map, MapAxis
from mpp_taichi.plots.painters import SvgPainter, text_width
from mpp_taichi.plots.panel import Panel
from mpp_taichi.plots.sheet import Sheet, arranged
from mpp_taichi.plots.svg import draw_svg
from mpp_taichi.plots.theme import DARK, LIGHT

# Taichi flushes subnormal numbers to zero in the process that it starts in, where hypothesis cannot make any.
NUMBERS = st.floats(-1e9, 1e9, allow_subnormal=False).filter(lambda value: value == 0.0 or abs(value) > 1e-9)


def curves(*columns: np.ndarray, **options) -> Curves:
    """A plot of the columns over the first of them."""
    samples = Samples()
    samples.open(len(columns))
    for row in np.array(columns).T:
        samples.add(row)
    names = tuple(f"curve {number}" for number in range(1, len(columns) - options.get("theories", 0)))
    return Curves("", "x", "", names, "", samples, 0, tuple(range(1, len(columns))), **options)


@settings(max_examples=200, deadline=None)
@example(first=[399584433.0], more=[0.5], most=2)
@given(st.lists(NUMBERS, min_size=1, max_size=5), st.lists(NUMBERS, min_size=1, max_size=5), st.integers(2, 12))
def test_an_axis_holds_its_values_and_its_labels_are_its_ticks(first, more, most):
    axis = Axis.of(np.array(first))
    grown = axis.grown(np.array(more))
    assert axis.covers(np.array(first)) and grown.covers(np.array(first + more))
    for each in (axis, grown):
        ticks, power = each.ticks(most)
        assert len(ticks) <= most + 1
        factor = 10.0 ** int(re.sub("×10", "", power).translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-"))) if power else 1.0
        for tick in ticks:
            written = float(tick.label.replace("−", "-")) * factor
            # Rounded to the digits that are shown, half of the last of them; ticks are at least that far apart.
            assert each.share(np.array(written)) == pytest.approx(tick.share, abs=1e-6)
            # A tick may lie 1e-9 of a step behind an end, and a step is at most 2.5 / most of the axis.
            slack = 1e-9 * 2.5 / most + 2.0**-52
            assert -slack <= tick.share <= 1.0 + slack


def test_a_logarithmic_axis_has_decades_and_no_place_for_zero():
    axis = Axis.of(np.array([0.0, 3e-9, 2e-6]), logarithmic=True)
    assert (axis.low, axis.high) == (-9.0, -5.0)
    assert [tick.label for tick in axis.ticks(8)[0]] == ["10⁻⁹", "10⁻⁸", "10⁻⁷", "10⁻⁶", "10⁻⁵"]
    assert np.isnan(axis.share(np.array([0.0, -1.0]))).all()
    assert axis.value(0.5) == pytest.approx(1e-7)


def test_a_growing_panel_is_the_one_that_is_drawn_at_once():
    """Where lines join they may be rounded otherwise, hence the few pixels: a part of 3 × 3 per sample."""
    time = np.linspace(0.0, 10.0, 60)
    whole = curves(time, np.sin(time), np.cos(2.0 * time), span=(0.0, 10.0))
    grows = curves(np.zeros(0), np.zeros(0), np.zeros(0), span=(0.0, 10.0))
    growing = Panel(grows, 400, 200, 12, DARK)
    for row in zip(time, np.sin(time), np.cos(2.0 * time)):
        grows.samples.add(np.array(row))
        last = growing.picture()
    fresh = Panel(whole, 400, 200, 12, DARK)
    fresh._wanted, fresh._fitted, fresh._generation = growing._wanted, True, whole.samples.generation
    fresh._blank(whole)
    difference = np.abs(np.asarray(last).astype(int) - np.asarray(fresh.picture()).astype(int)).max(axis=2)
    assert (difference > 100).sum() < 9 * len(time) / 10
    assert difference.mean() < 1.0


def test_the_curve_is_where_its_values_are_and_nowhere_else():
    x = np.linspace(0.0, 1.0, 200)
    panel = Panel(curves(x, np.where(np.abs(x - 0.5) < 0.1, np.nan, x**2)), 500, 300, 12, LIGHT)
    picture = np.asarray(panel.picture()).astype(int)
    left, top, right, bottom = panel.frame.field
    blue = np.abs(picture - LIGHT.curve(0)).max(axis=2) < 60
    for value in (0.1, 0.3, 0.8):
        column = round(left + float(panel.axes[0].share(np.array(value))) * (right - left))
        row = bottom - float(panel.axes[1].share(np.array(value**2))) * (bottom - top)
        rows = np.flatnonzero(blue[top:bottom, column]) + top + 0.5
        assert len(rows) > 0 and np.abs(rows - row).max() < 3.0  # half of the line's width, and its slope
    middle = round(left + float(panel.axes[0].share(np.array(0.5))) * (right - left))
    assert not blue[top:bottom, middle - 5 : middle + 5].any(), "a gap where there is no value"


def test_values_are_read_off_at_the_cursor():
    x = np.linspace(0.0, 10.0, 101)
    panel = Panel(curves(x, 3.0 * x, span=(0.0, 20.0)), 500, 300, 12, DARK)
    panel.picture()
    left, top, right, bottom = panel.frame.field
    reading = read(panel, left + 0.25 * (right - left), top + 10)
    assert [text for text, _ in reading.lines] == ["x = 5", "curve 1 = 15"]
    assert read(panel, left + 0.75 * (right - left), top + 10) is None, "nothing was recorded there yet"
    assert read(panel, left - 5, top + 10) is None
    angle = np.linspace(0.0, 6.0, 61)
    circle = Panel(curves(np.cos(angle), np.sin(angle), equal=True), 300, 300, 12, DARK)
    circle.picture()
    point = circle.frame.points(circle.axes[0].share(np.cos(angle[20:21])), circle.axes[1].share(np.sin(angle[20:21])))[0]
    lines = [text for text, _ in read(circle, point[0] + 2, point[1] - 1).lines]
    assert lines == [f"x = {np.cos(2.0):.5g}".replace("-", "−"), f"curve 1 = {np.sin(2.0):.5g}"]
    (x0, y0), (x1, y1) = circle.frame.points(circle.axes[0].share(np.array([0, 1])), circle.axes[1].share(np.array([0, 1])))
    assert x1 - x0 == pytest.approx(y0 - y1), "a circle is round"


def test_an_svg_file_holds_every_point():
    x = np.linspace(0.0, 1.0, 30)
    plots = [
        curves(x, np.sqrt(x), 1.0 - x, x, theories=1),
        Histogram("", "speed", "m/s", True, 3, np.arange(4.0), np.array([0.5, 0.3, 0.2]), x, x),
    ]
    root = ElementTree.fromstring(draw_svg(plots, (640, 360), 14))
    lines = [each.attrib["points"].split() for each in root.iter("{http://www.w3.org/2000/svg}polyline")]
    assert [len(points) for points in lines] == [30, 30, 30, 30]
    theory, falling, root_curve, _ = (np.array([point.split(",") for point in line], float) for line in lines)
    assert np.diff(theory[:, 1]).max() < 0.0 < np.diff(falling[:, 1]).min(), "down the page is down"
    # Pixels are written with two decimals, and the ends of sqrt are those of x.
    assert root_curve[[0, -1], 1] == pytest.approx(theory[[0, -1], 1], abs=0.01)
    assert "speed [m/s]" in "".join(root.itertext())


class Placed(SvgPainter):
    """Keeps the box of each text: left, right and the middle of the line."""

    def __init__(self):
        SvgPainter.__init__(self)
        self.texts = {}

    def text(self, x, y, text, color, size, anchor="l"):
        if text:
            left = x - {"l": 0.0, "m": 0.5, "r": 1.0}[anchor] * text_width(text, size)
            self.texts[text] = (left, left + text_width(text, size), y, size)


@pytest.mark.parametrize("label", ["t", "a long name of the axis along x"])
def test_the_texts_of_a_panel_have_their_places_and_do_not_cover_each_other(label):
    """Title, legend, numbers and names of the axes lie within the panel; the title in its upper left corner."""
    x, size = np.linspace(0.0, 1e4, 30), 12
    plot = replace(curves(x, 3.0 * x, 1.0 + x, theories=1), title="energy of the whole", x_label=label, x_unit="s", y_unit="J")
    frame = PanelFrame.of(plot, 400, 220, size, LIGHT)
    painter = Placed()
    frame.draw(painter, plot, *fitting_axes(plot), LIGHT)
    boxes = painter.texts
    assert {"energy of the whole", "curve 1", "theory"} <= set(boxes) and any(label in text for text in boxes)
    left, _, middle, height = boxes["energy of the whole"]
    # Less than a letter from the left edge; its middle at most a line, 1.2 of the letters, below the upper edge.
    assert 0.0 < left < size and 0.5 * height < middle < 1.2 * size
    _, top, right, bottom = frame.field
    for text, (begin, end, y, height) in boxes.items():
        assert 0.0 <= begin and end <= 400.0 and 0.5 * height <= y <= 220.0 - 0.5 * height, text
        assert not (top + 1 < y < bottom - 1 and begin < right and end > frame.field[0]), f"{text} is in the field"
        for other, (others, end_of_other, level, _) in boxes.items():
            assert text == other or abs(y - level) > 0.5 * height or end <= others or end_of_other <= begin, (text, other)


def test_a_few_numbers_far_from_all_others_leave_the_colours_of_a_map_to_the_others():
    """Of 1,000 numbers, 996 lie between 100 and 101. Numbers that lie by less than half of this range beyond it have a colour
    of their own, and numbers that lie further away have the colour of the end of the bar, within a hundredth of the range."""
    close, low, high = np.linspace(100.0, 101.0, 996), [99.7, 99.6], [101.9, 250.0]
    values = np.concatenate([low, close, high]).reshape(25, 40)
    axes = MapAxis("x", np.arange(40.0)), MapAxis("y", np.arange(25.0))
    found = Map("", *axes, values, np.zeros(values.shape, bool)).extent
    assert found[0] == 99.6 and found[1] == pytest.approx(101.0, abs=0.01)
    assert Map("", *axes, -values, np.zeros(values.shape, bool)).extent == pytest.approx((-found[1], -found[0]), abs=1e-9)


@pytest.mark.parametrize(
    ("count", "size", "expected"),
    [(1, (448, 720), (1, 1)), (3, (448, 720), (3, 1)), (3, (1280, 250), (1, 3)), (4, (1280, 400), (2, 2))],
)
def test_panels_are_arranged_by_the_shape_of_their_place(count, size, expected):
    assert arranged(count, size) == expected


def test_a_sheet_shows_its_panels_in_their_places():
    x = np.linspace(0.0, 1.0, 50)
    sheet = Sheet([curves(x, x), curves(x, 1.0 - x)], (300, 400), 12)
    picture = sheet.picture()
    assert picture.shape == (400, 300, 3)
    for panel, (left, top) in zip(sheet.panels, sheet.corners):
        assert np.array_equal(picture[top : top + panel.frame.height, left : left + panel.frame.width], panel.picture())
    assert not np.array_equal(picture, sheet.picture((150, 100))), "the cursor shows values"


def test_samples_beyond_the_limit_are_thinned(monkeypatch):
    monkeypatch.setattr("mpp_taichi.plots.content.MOST_KEPT", 100)
    samples = Samples()
    samples.open(1)
    for number in range(250):
        samples.add(np.array([float(number)]))
    kept = samples.column(0)
    assert kept[0] == 0.0 and kept[-1] == 249.0 and np.all(np.diff(kept) > 0.0) and len(kept) <= 100
    assert samples.generation > 0, "who drew them must draw them anew"
