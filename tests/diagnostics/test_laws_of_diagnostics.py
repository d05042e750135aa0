"""Diagnostics of particles other than the first, from times other than zero, and errors that are as large as they say."""

import math

import numpy as np
import pytest
from compiled import snapshot_of
from measured import MadeUpSample, measuring

from mpp_taichi.diagnostics._gas import BLOCKS, Total
from mpp_taichi.quantities._base import NoResultError

BEGIN = 3.0  # an odd time to begin at


def seen(name, motion, times, of=2, center=1, **parameters):
    """The result after samples of a motion of the third particle; `center` stands still, and another particle far away."""
    diagnostic = measuring(name, of=of, **parameters)
    for time in times:
        position, velocity = np.full((3, 3), 90.0), np.zeros((3, 3))
        position[center] = 0.5, -0.25, 0.0
        position[2], velocity[2] = motion(time)
        diagnostic.observe(MadeUpSample(snapshot_of(position, velocity=velocity), time))
    return diagnostic.result()


def circle(time):
    """A turn in 4 around the particle that stands still, in the plane x–y."""
    angle, rate = 0.5 * math.pi * time, 0.5 * math.pi
    turned = np.array([math.cos(angle), math.sin(angle), 0.0])
    return np.array([0.5, -0.25, 0.0]) + 2.0 * turned, 2.0 * rate * np.array([-turned[1], turned[0], 0.0])


def cubic(time):
    """A polynomial of the third degree for each axis, which two samples with their rates determine."""
    values = [c * time**3 - 2.0 * time**2 + d * time + 1.0 for c, d in ((1.0, 3.0), (0.5, -1.0), (-2.0, 0.25))]
    rates = [3.0 * c * time**2 - 4.0 * time + d for c, d in ((1.0, 3.0), (0.5, -1.0), (-2.0, 0.25))]
    return np.array(values), np.array(rates)


@pytest.mark.parametrize("around", [0, 1])
def test_the_period_of_any_orbit_begins_where_the_samples_begin(around):
    """The angle grows linearly in time, so that the cubic through angles and rates is exact."""
    times = BEGIN + np.arange(50) * 0.1
    assert seen("orbital_period", circle, times, center=around, around=around) == pytest.approx(4.0, rel=1e-12)
    with pytest.raises(NoResultError, match="did not complete a turn"):
        seen("orbital_period", circle, times[:40], center=around, around=around)


@pytest.mark.parametrize("axis", "xyz")
def test_a_coordinate_at_a_time_is_on_the_cubic_between_samples_that_begin_late(axis):
    at = BEGIN + 0.3125
    for name, row in (("position", 0), ("end_position", 0), ("end_velocity", 1)):
        more = {"of": (2, 1), "at": at} if name == "position" else {"of": 2}
        found = seen(name, cubic, [BEGIN, BEGIN + 0.75], axis=axis, **more)
        expected = cubic(at if name == "position" else BEGIN + 0.75)[row]["xyz".index(axis)]
        assert found == pytest.approx(expected, rel=1e-12), name


@pytest.mark.parametrize("at", [BEGIN - 0.5, BEGIN + 1.5])
def test_a_time_before_or_after_the_run_has_no_coordinate(at):
    with pytest.raises(NoResultError, match="not at"):
        seen("position", cubic, [BEGIN, BEGIN + 0.75], of=(2, 1), axis="x", at=at)


def test_the_error_of_a_rate_is_the_scatter_of_rates_over_many_seeds(request):
    """Totals of independent growth, with the same mean. The mean of the squared errors over n seeds has the relative
    error √(2 / (9 n)), the variance of n rates √(2 / n): together 0.075 for n = 400, and the bound is five times as much.
    """
    random, seeds = np.random.default_rng(request.config.getoption("--seed")), 400
    rates, errors = [], []
    for _ in range(seeds):
        total, grown = Total(), np.cumsum(random.poisson(5.0, 20 * BLOCKS))
        for number, value in enumerate([0, *grown]):
            total.add(BEGIN + 0.5 * number, float(value))
        rates.append(total.rate())
        errors.append(total.standard_error())
    assert np.mean(rates) == pytest.approx(10.0, abs=5 * math.sqrt(5.0 / (20 * BLOCKS)) / 0.5 / math.sqrt(seeds))
    assert np.mean(np.square(errors)) / np.var(rates, ddof=1) == pytest.approx(
        1.0, abs=5 * math.sqrt(2 / seeds + 2 / (9 * seeds))
    )


def test_a_rate_needs_two_samples_and_its_error_eleven():
    total = Total()
    with pytest.raises(NoResultError, match="no two samples"):
        total.rate()
    for number in range(BLOCKS + 1):
        total.add(float(number), 99.0)
        total.add(float(number), 3.0 * number)  # of two samples at one time the second counts
        if number < BLOCKS:
            with pytest.raises(NoResultError, match="say nothing of their scatter"):
                total.standard_error()
    assert total.rate() == 3.0 and total.standard_error() == 0.0 and len(total.times) == BLOCKS + 1
