"""Error bars against repeated seeds: does an estimate scatter as much as its error bar claims?"""

import numpy as np
from scipy import stats

FALSE_ALARM = 1e-6
"""Probability that the test of a sound error bar is red; the seeds are fixed, so that a test that was green stays green."""


def share_of_scatter(estimates, claims):
    """The variance of the estimates over the mean of the squares of their claimed standard errors: 1 for sound error bars."""
    return float(np.var(estimates, ddof=1) / np.mean(np.square(claims)))


def allowed_share(seeds, freedoms, *, chance=FALSE_ALARM):
    """The two ends between which `share_of_scatter` lies but with the probability `chance`.

    Of n normal estimates (n − 1) s²/σ² has the χ² distribution of n − 1 degrees of freedom. A claim from ν degrees of freedom
    has ν c²/σ² of χ² with ν, and the mean of n of them n ν degrees. The share is the ratio of both over their degrees, which
    has Fisher's F distribution. With claims that are known numbers ν is infinite, and χ² alone is left.
    """
    low, high = 0.5 * chance, 1.0 - 0.5 * chance
    if np.isinf(freedoms):
        return tuple(float(stats.chi2.ppf(each, seeds - 1) / (seeds - 1)) for each in (low, high))
    return tuple(float(stats.f.ppf(each, seeds - 1, seeds * freedoms)) for each in (low, high))


def claims_hold(estimates, claims, freedoms, *, truth=1.0, chance=FALSE_ALARM):
    """Whether the share of the scatter is `truth`, the share that theory gives, within what chance allows."""
    low, high = allowed_share(len(estimates), freedoms, chance=chance)
    return low <= share_of_scatter(estimates, claims) / truth <= high
