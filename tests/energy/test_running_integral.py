"""The running integral: exact for cubics, fourth order otherwise, whatever the spacing."""

import numpy as np
import pytest

from mpp_taichi.energy.running_integral import RunningIntegral


def integrate(times, function):
    running = RunningIntegral()
    for time in times:
        running.add(time, np.asarray(function(time)))
    return running.value


@pytest.mark.sampled(2)
@pytest.mark.parametrize("count", [1, 2, 3, 4, 9])
def test_polynomials_are_integrated_exactly_as_far_as_the_samples_determine_them(count):
    """From the first sample on: a line through two, a parabola through three, a cubic from four on."""
    times = 0.3 + np.cumsum([0.0, 0.1, 0.25, 0.1, 0.2, 0.3, 0.3, 0.15, 0.1])[:count]
    polynomial = np.polynomial.Polynomial([0.7, -2.0, 3.0, -4.0][: min(count, 4)])
    exact = polynomial.integ()(times[-1]) - polynomial.integ()(times[0])
    assert float(integrate(times, polynomial)) == pytest.approx(exact, rel=1e-14, abs=1e-15)


def spaced(count, pattern):
    gaps = np.resize(np.array(pattern, float), count)
    return np.concatenate([[0.0], np.cumsum(gaps)]) / gaps.sum()


def spiral(t):
    """e^{(1 + 7i) t}, whose error has no zero that a single component would pass through."""
    value = np.exp((1 + 7j) * t)
    return [value.real, value.imag]


EXACT = np.array([((np.exp(1 + 7j) - 1) / (1 + 7j)).real, ((np.exp(1 + 7j) - 1) / (1 + 7j)).imag])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("pattern", [[1], [1, 1, 1, 0.3], [1, 1, 1e-9], [0.01, 1, 1, 1], [1, 2, 0.5]])
def test_the_order_is_four_at_any_spacing(pattern):
    counts = [60, 120, 240, 480]
    errors = [np.linalg.norm(integrate(spaced(count, pattern), spiral) - EXACT) for count in counts]
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(4.0, abs=0.1)


def test_samples_an_instant_apart_amplify_no_noise():
    """A shortened last step of 1e-9 of a step, in every third interval, must not divide noise of 1e-7 by 1e-9."""
    random = np.random.default_rng(2)
    noisy = integrate(spaced(3000, [1, 1, 1e-9]), lambda t: spiral(t) + 1e-7 * random.standard_normal(2))
    # Weights are at most a few tenths of the interval / (ratio of intervals ≥ 1/4)³: some ten; 3000 random terms of h = 1/2000.
    assert np.linalg.norm(noisy - EXACT) < 10 * 1e-7 * 3000**0.5 / 2000


def test_a_jump_between_two_pieces_costs_nothing():
    running = RunningIntegral()
    for time in np.linspace(0, 1, 9):
        running.add(time, np.array([time**3]))
    running.cut()
    for time in np.linspace(1, 2, 9):
        running.add(time, np.array([5.0 - time**3]))
    assert float(running.value[0]) == pytest.approx(0.25 + 5.0 - 3.75, rel=1e-15)
