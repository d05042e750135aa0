"""The standard errors of a histogram of speeds against the scatter of its densities over repeated seeds."""

import numpy as np
import pytest
from repeated_seeds import FALSE_ALARM, claims_hold
from test_gas_recorders import histogram

from mpp_taichi.recorders.speed_histogram import BINS

SEEDS, COUNT, FASTEST = 600, 500, 9.0
FEW = 10  # particles in a bin: above, the number is normal enough for the distribution of its variance


def drawn(random, at_rest):
    """Velocities along x: a share of the particles rests, the speeds of the others are even, the last is the fastest.

    The fastest particle is the same for every seed, so that the edges of the bins are.
    """
    speed = random.uniform(0.1, 2.9, COUNT) * (random.random(COUNT) >= at_rest)
    speed[-1] = FASTEST
    return speed[:, None] * [1.0, 0.0, 0.0]


@pytest.mark.parametrize("at_rest", [0.0, 0.3, 0.8])
def test_the_standard_error_of_a_bin_is_its_scatter_over_seeds(at_rest):
    """The number of particles in a bin is binomial; √(n p (1 − p)) is far below √(n p) where most particles are in the bin.

    A claim follows its own number, and its square scatters by less than 1/√10 over the seeds: of the mean of 600 this is below
    1.3 %, beside 5.8 % of the variance. It counts as known. The chance of a false alarm is shared among the bins.
    """
    random = np.random.default_rng([27, round(10 * at_rest)])
    particles = [{"gas": {"count": COUNT, "lower": [0, 0], "upper": [9, 9], "radius": 0.0, "mass": 2, "temperature": 1.0}}]
    recorder = histogram(velocity=drawn(random, at_rest), particles=particles)
    found = []
    for _ in range(SEEDS):
        recorder.restart()
        recorder.add(drawn(random, at_rest))
        found.append(recorder.columns())
    width = np.diff(found[0]["edge"])
    assert all(np.array_equal(each["edge"], found[0]["edge"]) for each in found)
    density = np.array([each["density"] for each in found])
    claims = np.array([each["standard_error"] for each in found])
    filled = np.flatnonzero(density.mean(axis=0) * width * COUNT >= FEW)
    assert len(filled) >= 9  # from 0 to 2.9 there are ten bins
    for number in filled:
        assert claims_hold(density[:, number], claims[:, number], np.inf, chance=FALSE_ALARM / BINS), number
