"""The standard error of a measured frequency against the scatter of the frequency over repeated seeds."""

import math

import numpy as np
import pytest
from repeated_seeds import claims_hold

from mpp_taichi.modes.frequency_meter import FrequencyMeter

SEEDS, HALF_PERIOD, SCATTER = 400, 2.0, 0.01


def measured(times):
    """The frequency of a value that goes along straight lines through 0 at these times, up and down in turn."""
    meter = FrequencyMeter()
    for number, time in enumerate(times):
        sign = 1.0 if number % 2 else -1.0
        for side in (-0.25, 0.25):  # the cubic of a straight line is the line, so that the crossing is at the time
            meter.observe(time + side, sign * side, sign)
    found = meter.measured()
    return found.angular_frequency, found.uncertainty


@pytest.mark.parametrize("crossings", [4, 5, 40])
@pytest.mark.parametrize("off_centre", [0.0, 0.3])
@pytest.mark.sampled(3)
def test_the_standard_error_of_a_frequency_is_its_scatter_over_seeds(crossings, off_centre):
    """Crossings at even times with independent normal errors; off centre, the downward crossings are late by 0.3.

    Two offsets and a slope are fitted to n crossings, so that n − 3 degrees of freedom are left. The frequency is π over the
    slope, whose error is below 1 % of it: the square of this is what the claim leaves out.
    """
    random = np.random.default_rng([27, crossings, round(10 * off_centre)])
    even = 1.0 + HALF_PERIOD * np.arange(crossings) + off_centre * (np.arange(crossings) % 2)
    found = np.array([measured(even + SCATTER * random.normal(size=crossings)) for _ in range(SEEDS)])
    assert claims_hold(*found.T, crossings - 3)
    error = found[:, 0].mean() - math.pi / HALF_PERIOD
    # The mean of the claims' squares is their variance; five standard errors, and the second order of π over the slope.
    assert abs(error) < 5.0 * math.sqrt(np.mean(found[:, 1] ** 2) / SEEDS) + 0.01**2 * math.pi / HALF_PERIOD
