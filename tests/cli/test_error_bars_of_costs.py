"""The noise of the costs that `explain` tells against the scatter of the costs over repeated seeds."""

import numpy as np
import pytest
from repeated_seeds import FALSE_ALARM, claims_hold
from scipy import stats

from mpp_taichi.cli._costs import ROUNDS, _cost

SEEDS, STEP, EFFECT, NOISE = 400, 50e-9, 7e-9, 2e-9


def told(random, rounds):
    """Cost of an effect and its standard error, half of the noise, from timings with independent normal errors."""
    full = random.normal(STEP, NOISE, rounds)
    found = _cost("spring", list(full), list(full + EFFECT + random.normal(0.0, NOISE, rounds)))
    return found.seconds, 0.5 * found.noise


def test_the_noise_of_a_cost_is_two_standard_errors_over_seeds():
    """The formula is of many rounds, here 401.

    The interquartile range of n normal numbers has the relative error 1.17/√n, 6 % for 401, and of the mean of the squares over
    400 seeds only a bias of 0.3 % is left: the claim counts as known. 1.85 stands for 2 · 1.2533/1.3490 = 1.858, and
    the squares differ by 0.9 %.
    """
    random = np.random.default_rng(27)
    found = np.array([told(random, 401) for _ in range(SEEDS)])
    assert claims_hold(*found.T, np.inf)


@pytest.mark.parametrize("rounds", [2, 3, 4, 7, ROUNDS])
def test_the_noise_of_a_few_rounds_is_no_shorter_than_the_scatter(rounds):
    """With few rounds the range is that of an order statistic, farther out than the quartile, so that the noise is longer.

    A long noise calls a small share not measurable; a short noise would call chance a share.
    """
    random = np.random.default_rng([28, rounds])
    found = np.array([told(random, rounds) for _ in range(SEEDS)])
    share = np.var(found[:, 0], ddof=1) / np.mean(found[:, 1] ** 2)
    assert share < stats.chi2.ppf(1.0 - FALSE_ALARM, SEEDS - 1) / (SEEDS - 1)
