"""Growth and cause of errors: crossings, laws and their extrapolation, and the step told from rounding, on made-up errors."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpp_taichi.horizon.cause import cause_of
from mpp_taichi.horizon.growth import first_crossing, law, turns
from mpp_taichi.horizon.work_budget import WorkBudget

TIMES = np.linspace(0.0, 10.0, 49)[1:]
LEAPFROG, ORDER_8 = (SimpleNamespace(order=order, controlled_by="") for order in (2, 8))


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_a_power_of_time_is_crossed_where_it_reaches_the_limit_and_goes_on_as_this_power(power):
    errors = 1e-3 * (TIMES / 7.0) ** power
    assert first_crossing(TIMES, errors, 1e-3) == pytest.approx(7.0, rel=1e-9)  # interpolation in logarithms is exact
    growth = law(TIMES, 1e-3 * errors)
    assert growth.rate is None and growth.power == pytest.approx(power, rel=1e-9)
    assert growth.time_of(1e-3) == pytest.approx(7.0 * 1e3 ** (1.0 / power), rel=1e-9)
    assert growth.at(growth.time_of(1e-3)) == pytest.approx(1e-3)


def test_exponential_growth_is_extrapolated_exponentially():
    growth = law(TIMES, 1e-12 * np.exp(TIMES))
    assert growth.power is None and growth.rate == pytest.approx(1.0)
    assert growth.time_of(1e-3) == pytest.approx(9.0 * np.log(10.0), rel=1e-9)


def test_an_error_that_stays_below_the_limit_does_not_cross_it_and_an_infinite_error_does():
    assert first_crossing(TIMES, np.full(48, 9e-4), 1e-3) is None
    broken = np.where(TIMES < 5.0, 1e-6, np.inf)
    assert first_crossing(TIMES, broken, 1e-3) == pytest.approx(TIMES[TIMES < 5.0][-1])


def test_turns_count_revolutions_and_a_straight_line_has_none():
    phase = np.linspace(0.0, 2.0 * np.pi * 6.0, 400)
    circle = np.stack([np.cos(phase), np.sin(phase), 0.0 * phase], axis=-1)[:, None, :]
    straight = phase[:, None, None] * np.array([1.0, 0.0, 0.0])
    # The way is 6 · 2π, the extent the diagonal 2 √2 of the square around it: 6 π / (2 √2) = 6.7 turns there and back.
    assert turns(circle) == pytest.approx(6.0 * np.pi / (2.0 * np.sqrt(2.0)), rel=0.01)
    assert turns(straight) == pytest.approx(0.5)


def test_the_step_is_the_cause_where_differences_fall_with_its_order_and_the_error_follows():
    error = 1e-5 * TIMES
    cause = cause_of(3.0 * error, 0.75 * error, 100.0 * TIMES, "f64", LEAPFROG)  # (2² − 1) e and (1 − 2⁻²) e
    assert cause.by == "step"
    assert cause.errors(3.0 * error, 0.75 * error) == pytest.approx(error)
    assert cause.errors(3.0 * error, 0.75 * error[:12]) == pytest.approx(error)  # beyond the fine rerun by the coarse one


def test_rounding_is_the_cause_where_differences_are_at_its_level_and_do_not_fall():
    steps = 100.0 * TIMES
    level = 2.0**-24 * np.sqrt(steps)
    coarse, fine = np.sqrt(1.5) * level, np.sqrt(3.0) * level
    cause = cause_of(coarse, fine, steps, "f32", LEAPFROG)
    assert cause.by == "rounding"
    # The standard deviation of the best linear estimate is √(35/49) of the standard deviation of the error;
    # differences of these sizes, all of one sign, give (4 √1.5 + √3) / 7 = 0.95 of the error.
    assert cause.errors(coarse, fine) == pytest.approx(0.947 * level, rel=1e-3)


def test_a_coarse_rerun_that_is_off_by_its_own_step_does_not_hide_rounding():
    steps = 100.0 * TIMES
    fine = np.sqrt(3.0) * 2.0**-24 * np.sqrt(steps)
    cause = cause_of(10.0 * fine, fine, steps, "f32", ORDER_8)  # a ratio of 10, where the step alone has 256
    assert cause.by == "rounding"
    assert cause.errors(10.0 * fine, fine) == pytest.approx(fine / np.sqrt(3.0))


def test_a_long_run_is_followed_for_a_share_of_its_work_and_a_short_run_as_a_whole():
    assert WorkBudget(step=100.0, run=1e12, share=0.02, least=1e7).part == pytest.approx(0.02 / 2.0)
    assert WorkBudget(step=100.0, run=1e6, share=0.02, least=1e7).part == 1.0
