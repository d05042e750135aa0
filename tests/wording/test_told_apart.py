"""Numbers that a sentence compares: a reader sees which is the larger one."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpp_taichi.report.expectations import bound_text, value_text
from mpp_taichi.scene.spec import Expectation, Location
from mpp_taichi.wording.told_apart import told_apart

finite = st.floats(-1e300, 1e300, allow_subnormal=False)
near_one = st.integers(-3, 3).map(lambda k: 1.0 + k * 2.0**-52)


@given(st.lists(finite | near_one, min_size=2, max_size=4))
def test_texts_are_in_the_order_of_the_values(values):
    numbers = [float(text) for text in told_apart(*values)]
    for first, first_told in zip(values, numbers):
        for last, last_told in zip(values, numbers):
            assert (first < last) == (first_told < last_told)


def test_numbers_that_differ_early_have_no_more_digits_than_asked_for():
    assert told_apart(1.23456789, 2.0, digits=3) == ("1.23", "2")
    assert told_apart(1.5e-6, 1.5e-6) == ("1.5e-06", "1.5e-06")
    assert told_apart(1.0, 1.0 + 1e-9) == ("1", "1.000000001")


def test_energies_of_a_blow_up_differ_in_their_texts():
    """Beside the potential energy of held bodies, a gain may be small."""
    for first, last in ((1.5e-6, 1.5e-6 + 2e-12), (1.5, 2.5e9), (-1.00049, -1.0), (0.0, 1e-300), (1.0, math.nan)):
        told = told_apart(first, last)
        assert told[0] != told[1]
        assert math.isnan(last) or float(told[0]) < float(told[1])


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("key", ["below", "above", "near"])
def test_a_verdict_shows_on_which_side_of_its_bound_a_value_lies(key, sign):
    """Values are one rounding apart from the bound, which nine digits cannot show."""
    limit = {"f64": 0.7, "f32": 0.7}
    nothing = {"below": None, "above": None, "near": None, "within": None}
    said = {"near": 0.5, "within": {"f64": 0.4, "f32": 0.4}} if key == "near" else {key: limit}  # near: 0.3 … 0.7
    expectation = Expectation("any", {}, location=Location("scene", 1, 1), **(nothing | said))
    value = math.nextafter(0.5 + 0.2, 1.0 if sign > 0.0 else 0.0)
    told = float(value_text(expectation, "f64", value))
    assert told != 0.7 and (told > 0.7) == (sign > 0.0)
    if key != "near":
        assert float(bound_text(expectation, "f64", value).split()[1]) == 0.7
