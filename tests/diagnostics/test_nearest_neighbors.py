"""Distances of particles to their nearest neighbours, against SciPy's tree and the distribution of random points."""

import math

import numpy as np
import pytest
from compiled import snapshot_of
from measured import MadeUpSample, measuring
from scipy.spatial import cKDTree

from mpp_taichi.quantities._base import NoResultError
from mpp_taichi.quantities.nearest_neighbor_distance import nearest_distances


@pytest.mark.parametrize("shape", [(1.0, 1.0, 1.0), (1.0, 1e-3, 1e-3), (1e-3, 1.0, 0.0), (0.0, 1.0, 1.0)])
@pytest.mark.parametrize("count", [2, 3, 50, 700])
def test_each_finds_its_nearest_as_a_search_tree_does(count, shape):
    position = np.random.default_rng(count).random((count, 3)) * shape
    expected = cKDTree(position).query(position, 2)[0][np.argsort(position[:, 0], kind="stable"), 1]
    # A difference, its square and a root of their sum: some five roundings.
    assert nearest_distances(position) == pytest.approx(expected, rel=5 * 2.0**-53)


def test_two_at_one_place_are_no_distance_apart():
    assert list(nearest_distances(np.zeros((4, 3)))) == [0.0] * 4


def test_particles_at_random_are_as_near_as_chance_has_it():
    count, random = 4000, np.random.default_rng(2)
    position = np.column_stack([random.random((count, 2)), np.zeros(count)])
    # A square without rim would have ½/√n; the rim adds 0.0514 · 4/n (Donnelly, Cambridge (1978)). Four standard deviations.
    expected, deviation = 0.5 / math.sqrt(count) + 0.0514 * 4 / count, 0.26 / count
    assert nearest_distances(position).mean() == pytest.approx(expected, abs=4 * deviation)


def test_a_group_is_looked_at_when_it_is_asked_for():
    place = np.array([[0.0, 0, 0], [0.1, 0, 0], [1.0, 0, 0], [3.0, 0, 0], [3.5, 0, 0]])
    found = {}
    for at in (None, 1.5):
        diagnostic = measuring("nearest_neighbor_distance", of=(1, 3), at=at)
        for time in (0.0, 1.0, 2.0, 3.0):
            diagnostic.observe(MadeUpSample(snapshot_of(place * (1.0 + time)), time))
            assert diagnostic.interval == (max(0.5, 1.5 - time) if at and time < at else math.inf)
        found[at] = diagnostic.result()
    # Three of the group: 0.9, 0.9 and 2 from the nearest of them, as large as the time says.
    assert found == {None: pytest.approx(4.0 * 3.8 / 3.0), 1.5: pytest.approx(3.0 * 3.8 / 3.0)}
    late = measuring("nearest_neighbor_distance", at=9.0)
    late.observe(MadeUpSample(snapshot_of(place)))
    with pytest.raises(NoResultError, match="before time 9"):
        late.result()
