"""Kolmogorov and Smirnov's test: does a sample come from a distribution?"""

import math

import numpy as np


def distance(values: np.ndarray) -> float:
    """D = sup |F_n − F| of a sample x, from the distribution's cumulative function there, F(x_i), in any order."""
    ordered = np.sort(np.asarray(values, dtype=float))
    count = len(ordered)
    if count == 0:
        raise ValueError("a sample of nothing has no distribution")
    steps = np.arange(count + 1) / count
    return float(max(np.max(steps[1:] - ordered), np.max(ordered - steps[:-1])))


def probability(distance_found: float, count: int) -> float:
    """Probability of a distance as large or larger, were the sample from the distribution.

    Q(λ) = 2 Σ (−1)^(k−1) exp(−2 k² λ²), λ = D (√n + 0.12 + 0.11/√n); good to 0.06/√n, and far better where it is small. A
    temperature taken from the same sample makes large distances rarer than this, so that a test by it is on the safe side.
    Source: Stephens, J. R. Stat. Soc. B 32 (1970) 115.
    """
    root = math.sqrt(count)
    x = (root + 0.12 + 0.11 / root) * distance_found
    if x < 0.2:
        return 1.0  # Q(0.2) differs from 1 by 10⁻¹², and the sum converges slowly
    terms = [(-1) ** (k - 1) * math.exp(-2.0 * (k * x) ** 2) for k in range(1, 101)]
    return min(1.0, max(0.0, 2.0 * math.fsum(terms)))


def critical_distance(count: int, level: float = 0.05) -> float:
    """The distance that chance exceeds with probability `level`: about 1.36/√n at 5 %."""
    low, high = 0.0, 10.0
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if probability(middle, count) > level else (low, middle)
    return 0.5 * (low + high)
