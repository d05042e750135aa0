"""The standard errors of means over blocks in `verify` against the scatter of the means over repeated seeds."""

import numpy as np
import pytest
from repeated_seeds import FALSE_ALARM, claims_hold
from scipy import stats

from mpp_taichi.verify.cases._gas import BLOCKS, of_blocks

SEEDS, THEORY = 4000, 3.0


@pytest.mark.parametrize("count", [5, BLOCKS, 100])
def test_the_standard_error_of_a_mean_of_blocks_is_its_scatter_over_seeds(count):
    random = np.random.default_rng([27, count])
    found = [of_blocks(THEORY + random.normal(size=count), THEORY, 0.0, "") for _ in range(SEEDS)]
    assert claims_hold([each.mean for each in found], [each.error for each in found], count - 1)


@pytest.mark.parametrize("count", [5, BLOCKS])
@pytest.mark.parametrize("chance", [0.5, 0.05, 0.005])
def test_a_sound_program_is_beyond_a_chance_as_often_as_the_chance_says(count, chance):
    """The number of such seeds is binomial."""
    random = np.random.default_rng([28, count])
    found = [of_blocks(THEORY + random.normal(size=count), THEORY, 0.0, "") for _ in range(SEEDS)]
    beyond = sum(each.chance < chance for each in found)
    low, high = stats.binom.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], SEEDS, chance)
    assert low <= beyond <= high


def test_an_error_of_the_theory_counts_for_nothing():
    values = np.array([3.1, 3.3, 3.2, 3.4])  # mean 3.25, standard deviation √(0.05/3)
    error = np.sqrt(0.05 / 3.0 / 4.0)
    assert of_blocks(values, THEORY, 0.3, "").z == 0.0
    assert of_blocks(values, THEORY, 0.05, "").z == pytest.approx(0.2 / error, rel=1e-12)
