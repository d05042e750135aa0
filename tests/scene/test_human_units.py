"""Units for readers: the unit of a time follows from the length of the run, and its digits do not change their number."""

import pytest

from mpp_taichi.scene.human_units import TimeScale, length_unit, time_text

SECONDS, DAYS = {"length": "m", "time": "s", "mass": "kg"}, {"length": "AU", "time": "day", "mass": "Msun"}


@pytest.mark.parametrize(
    ("units", "end", "time", "text"),
    [
        (SECONDS, 1.668e6, 1.668e6, "19.3 d"),
        (SECONDS, 1.668e6, 0.0, "0.0 d"),
        (SECONDS, 20.0, 3.14159, "3.1 s"),
        (SECONDS, 999.0, 57.0, "57 s"),
        (SECONDS, 3600.0, 1800.0, "30.0 min"),
        (SECONDS, 9000.0, 4500.0, "1.25 h"),
        (SECONDS, 2e-3, 1e-3, "1.00 ms"),
        (SECONDS, 2e-5, 1e-5, "10.0 µs"),
        (DAYS, 365.0, 203.4, "203 d"),
        (DAYS, 60190.0, 30095.0, "82 yr"),
        (DAYS, 0.05, 0.025, "36.0 min"),
        (None, 6.2832, 1.0, "1.00"),
        (None, 1.0, 0.5172, "0.52"),
        (None, 4e-4, 2e-4, "2.00e-4"),
        (None, 2.5e5, 1e5, "1.00e5"),
        (None, 2.5e4, 1e4, "10000"),
        (None, 1e12, 3e11, "0.30e12"),
        (DAYS, 1e14, 5e13, "1.37e5 Myr"),
        (SECONDS, 20.0, -1e-9, "0.0 s"),
    ],
)
def test_times_are_written_in_the_unit_of_the_run(units, end, time, text) -> None:
    assert TimeScale.of(units, end).text(time) == text


@pytest.mark.parametrize("end", [0.7, 1.0, 9.99, 10.0, 123.0, 1.668e6, 3e9])
@pytest.mark.parametrize("units", [SECONDS, DAYS, None])
def test_a_run_has_a_hundred_to_a_thousand_times_of_one_form(units, end) -> None:
    scale = TimeScale.of(units, end)
    texts = [scale.text(end * k / 5000) for k in range(5001)]
    assert len(set(texts)) >= 100
    assert len(set(texts)) <= 1001 or scale.decimals == 0
    assert len({text.partition(" ")[2] for text in texts}) == 1, "one unit"
    assert len({len(text.split(" ")[0].partition(".")[2]) for text in texts}) == 1, "one number of decimals"
    assert len({"e" in text for text in texts}) == 1


def test_a_run_without_an_end_keeps_the_scene_s_unit() -> None:
    assert TimeScale.of(SECONDS, float("inf")).text(1234.5678) == "1235 s"
    assert TimeScale.of(None, 0.0).text(0.5) == "0.5"


def test_a_single_time_has_another_unit_only_where_that_is_easier_to_read() -> None:
    assert time_text(SECONDS, 1.668e6) == "19.3 d"
    assert time_text(SECONDS, 20.0) == time_text(None, 1e9) == time_text(SECONDS, float("nan")) == ""


def test_lengths_keep_the_scene_s_unit_while_that_is_easy_to_read() -> None:
    assert length_unit(None, 1e9) == ("", 1.0)
    assert length_unit(DAYS, 0.02) == ("AU", 1.0)
    sign, size = length_unit(DAYS, 1e-5)
    assert sign == "km" and size == pytest.approx(1.0 / 149_597_870.7)
    assert length_unit(SECONDS, 3e-7)[0] == "nm"
