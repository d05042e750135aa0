"""Sums of several copies of a system: their bits do not depend on how many copies are summed together."""

import numpy as np

from mpp_taichi.energy.mechanics import FEW_COPIES, sums


def test_few_copies_are_summed_with_the_bits_of_many():
    random = np.random.default_rng(1)
    for _ in range(20):
        terms = random.standard_normal((2 * FEW_COPIES + 1, 57)) * 10.0 ** random.integers(-12, 12, (2 * FEW_COPIES + 1, 57))
        alone = np.concatenate([sums(row[None]) for row in terms])
        assert sums(terms).tobytes() == alone.tobytes()
