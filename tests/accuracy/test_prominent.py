"""The methods that plots show in colour, the names at the ends of lines, and the sentence of a study that was cut short."""

from xml.etree import ElementTree

import pytest

from mpp_taichi.accuracy import front, svg, table
from mpp_taichi.accuracy.prominent import groups, prominent
from mpp_taichi.accuracy.sample import Configuration, MeasuredError, Sample
from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from mpp_taichi.accuracy.verdict import sentence, verdict

# Errors C steps^-order of one problem, and seconds for a step: ruth3 and pefrl are on the front, rkn8 has the smallest error.
METHODS = {
    "euler": (1, 9.0, 1.0),
    "symplectic_euler": (1, 5.0, 1.0),
    "leapfrog": (2, 30.0, 1.5),
    "velocity_verlet": (2, 31.0, 1.6),
    "midpoint": (2, 32.0, 2.0),
    "rk4": (4, 900.0, 40.0),
    "ruth3": (3, 5.0, 1.0),
    "pefrl": (4, 0.5, 4.0),
    "kahan_li8": (8, 9.0, 900.0),
    "rkn8": (8, 1.0, 900.0),
    "yoshida4": (4, 2000.0, 5.0),
}
OWN = "midpoint"


def row(name, steps, precision="f64"):
    order, size, seconds = METHODS[name]
    configuration = Configuration(name, steps, precision, "cpu")
    sample = Sample(configuration, 1.0 / steps, evaluations=100 * int(seconds) * steps, seconds=[1e-6 * seconds * steps])
    return front.StudyRow(
        sample, *[MeasuredError(size / steps**order)] * 5, is_own=(name, steps, precision) == (OWN, 20, "f64")
    )


ROWS = [row(name, steps) for name in METHODS for steps in (10, 20, 40)] + [row("yoshida4", 10, "f32")]


def test_plots_show_the_front_the_own_setting_and_methods_that_readers_know():
    found = verdict(ROWS, "position", 1e-6)
    shown = prominent(ROWS, found, "position")
    names = [integrator for integrator, _, _ in shown]
    on_front = {each.sample.configuration.integrator for each in ROWS if each.sample.configuration.key in found["time_front"]}
    assert on_front and on_front <= set(names)
    assert {OWN, "euler", "leapfrog", "rk4", "rkn8"} <= set(names), "the own method, three known ones, and the most exact"
    assert not {"symplectic_euler", "velocity_verlet", "yoshida4"} & set(names), "the others are grey"
    assert names[-1] == "rkn8" and len(set(names)) == len(names) < len(groups(ROWS))
    without_euler = [each for each in ROWS if each.sample.configuration.integrator != "euler"]
    shown = prominent(without_euler, verdict(without_euler, "position", 1e-6), "position")
    assert "symplectic_euler" in {integrator for integrator, _, _ in shown}, "of each order one"


def drawn(series):
    return ElementTree.fromstring(svg.draw(Plot("p", "x", "y", series)))


def line(name, number, end, **more):
    marks = [PlotMark(1.0, 1.0), PlotMark(10.0, end, said=f"{name}: a run")]
    return Series(name, number, marks, labelled=number >= 0, **more)


def test_a_grey_series_says_its_name_under_the_pointer():
    picture = drawn([line("front", 0, 1e-3), line("others", -1, 1e-2)])
    space = {"s": svg.NAMESPACE}
    (rest,) = picture.findall("s:g[@class='rest']", space)
    assert rest.find("s:title", space).text == "others" and len(rest.findall("s:circle", space)) == 2
    assert [each.find("s:title", space).text for each in picture.iter(f"{{{svg.NAMESPACE}}}polyline")] == ["others", "front"]
    assert [text.text for text in picture.findall("s:text", space) if text.get("class") == "n0"] == ["front"]


@pytest.mark.parametrize("count", [3, 40])
def test_names_at_the_ends_of_lines_do_not_overlap_and_stay_within_the_plot(count):
    """All lines end at almost one place, which has room for a few names."""
    names = [f"method_{k}" for k in range(count)]
    picture = drawn([line(name, k, 1e-3 * (1.0 + 0.01 * k)) for k, name in enumerate(names)])
    texts = [each for each in picture.findall(f"{{{svg.NAMESPACE}}}text") if each.text in names]
    lines = sorted(float(each.get("y")) for each in texts)
    assert len(texts) == 3 if count == 3 else 3 <= len(texts) < count
    assert all(low - high >= svg.LINE_HEIGHT - 0.2 for high, low in zip(lines, lines[1:]))
    assert svg.TOP < lines[0] and lines[-1] < svg.HEIGHT - svg.BOTTOM
    assert all(float(each.get("x")) + svg.LETTER * len(each.text) <= svg.WIDTH - svg.RIGHT for each in texts)


def test_a_study_that_was_cut_short_recommends_no_method():
    found = verdict(ROWS, "position", 1e-6) | {"methods_tried": 2, "methods_suited": 31, "budget_ended": True}
    said = sentence(found)
    assert said.startswith("the budget ended when 2 of 31 methods had been tried; of these, ")
    assert "the others may be faster" in said and "take " not in said and "ten times less error" not in said
    assert "this scene's own setting (midpoint" in said and "goes on with the others" in said
    nothing = verdict(ROWS, "position", 1e-30) | {"methods_tried": 2, "methods_suited": 31, "budget_ended": True}
    assert "none of these reaches 1e-30 of position; rkn8 came to" in sentence(nothing)
    assert "for 1e-6 of position take " in sentence(found | {"budget_ended": False})


def test_the_key_explains_every_sign_and_column_of_the_table():
    for wanted in (None, "orbital_period"):
        told = " ".join(table.key(wanted))
        for sign in ("*:", "+:", "o:", "≤:", *(("position:", "(rms):") if wanted is None else ("orbital_period:",))):
            assert sign in told
        for name in ("energy", "momentum", "ang. mom."):
            assert name in table.head(wanted) and name in told
