"""Gravity by series over the nodes of a tree: accuracy, what is done where lists are full or groups are wide, and bits."""

import sys

import numpy as np
import pytest
from conftest import ROOT
from made_trees import Tree, direct, errors, tree_fixtures

from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi import bitcode
from mpp_taichi.neighbors.tree_nodes import preorder
from mpp_taichi.neighbors.tree_series import CAPACITY, MOST_LEAVES, TreeSeries, divided
from mpp_taichi.neighbors.tree_walk import TreeWalk

sys.path[:0] = [str(ROOT / "tools" / "benchmarks")]

from tree_bodies import bodies, exact  # noqa: E402

COUNT = 8000
fresh_runtime, trees, tree = tree_fixtures(COUNT)
pytestmark = [
    pytest.mark.fast_taichi("series_walk"),
    pytest.mark.skipif(
        not (sys.platform == "linux" and bitcode.has_avx512()), reason="series_walk needs Linux on a processor with AVX-512"
    ),
]


def found_and_exact(tree, kind, accuracy):
    """Accelerations by the tree and pair by pair of some bodies of a distribution."""
    position, mass = bodies(kind, COUNT)
    rows = np.random.default_rng(2).choice(COUNT, 400, replace=False)
    return tree.place(position, mass, accuracy).accelerations()[rows].astype(float), exact(position, mass, rows)[0]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["sphere", "plummer", "disc"])
def test_a_higher_order_takes_over_where_the_accuracy_is_high(tree, kind):
    for accuracy, order in ((1e-2, 6), (1e-4, 6), (1e-5, 8), (1e-6, 8)):
        found, true = found_and_exact(tree, kind, accuracy)
        assert tree.sum.walk.expansion_order == order
        assert np.percentile(errors(found, true), 99) <= accuracy


def test_distant_nodes_do_act_by_series(tree):
    """The errors are those of series, not the round-off of a direct sum, and each group has sources that are far."""
    found, true = found_and_exact(tree, "sphere", 1e-3)
    assert np.median(errors(found, true)) > 1e-8
    assert (tree.sum.estimate.variance.to_numpy() > 0.0).all()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["plummer", "shell"])
def test_groups_whose_lists_are_full_are_left_to_the_walk(tree, kind, monkeypatch):
    walk, calls = tree.sum.walk.walk, []
    run = walk.run
    monkeypatch.setattr(walk, "run", lambda *numbers, **names: (calls.append(1), run(*numbers, **names)))
    try:
        tree.sum.walk.describe(200, MOST_LEAVES)
        found, true = found_and_exact(tree, kind, 1e-3)
    finally:
        tree.sum.walk.describe(CAPACITY, MOST_LEAVES)
    assert calls
    assert np.percentile(errors(found, true), 99) <= 1e-3
    calls.clear()
    found_and_exact(tree, kind, 1e-3)
    assert not calls


@pytest.mark.parametrize("tree", ["f32", "f64"], indirect=True)
def test_in_wide_groups_each_body_walks_alone(tree):
    """The same near bodies, and series about each body instead of the center of its group: the accuracy holds."""
    position, mass = bodies("plummer", COUNT)
    rows = np.arange(0, COUNT, 20)
    true, well = direct(position, mass, rows, softening=0.01)
    tree.place(position, mass, 1e-3, softening=0.01)
    together = tree.accelerations()
    try:
        tree.sum.walk.describe(CAPACITY, 8)
        alone, potential = tree.accelerations(), tree.potentials()
    finally:
        tree.sum.walk.describe(CAPACITY, MOST_LEAVES)
    assert (alone != together).any(1).mean() > 0.9
    assert np.percentile(errors(alone[rows].astype(float), true), 99) <= 1e-3
    np.testing.assert_allclose(potential[rows], 0.5 * mass[rows] * well, rtol=1e-3)


@pytest.mark.sampled(2)
def test_a_far_body_does_not_take_the_range_of_f32():
    """Moments of order 5 of a cluster in units of a frame 10⁶ times as large would be below the smallest f32."""
    backends.start("cpu", "f32", threads=2)
    tree = Tree(COUNT)
    position, mass = bodies("plummer", COUNT)
    position[7] = (3e6, 0.0, 0.0)
    rows = np.arange(0, COUNT, 20)
    true, _ = exact(position, mass, rows)
    found = tree.place(position, mass, 1e-3).accelerations()[rows].astype(float)
    assert np.percentile(errors(found, true), 99) <= 1e-3
    assert np.median(errors(found, true)) > 1e-6  # by series, not by pairs


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_the_bits_of_series_do_not_depend_on_the_threads(precision):
    position, mass = bodies("plummer", COUNT)
    found = []
    for threads in (1, 2, 3):
        backends.start("cpu", precision, threads=threads)
        tree = Tree(COUNT).place(position, mass)
        assert isinstance(tree.sum.walk, TreeSeries)
        found.append((tree.accelerations(), tree.potentials()))
        backends.stop()
    for other in found[1:]:
        np.testing.assert_array_equal(other[0], found[0][0])
        np.testing.assert_array_equal(other[1], found[0][1])


@pytest.mark.sampled(2)
def test_without_series_a_tree_walks(monkeypatch):
    """In a plane, and where the part is off."""
    backends.start("cpu", "f64", threads=2)
    assert isinstance(Tree(100, 2).sum.walk, TreeWalk)
    monkeypatch.setattr("mpp_taichi.device.fast_taichi.series_walk.switch.is_on", lambda name: name != "series_walk")
    tree = Tree(COUNT)
    assert isinstance(tree.sum.walk, TreeWalk)
    for kind in ("sphere", "disc", "row"):
        for accuracy in (1e-3, 1e-5):
            assert np.percentile(errors(*found_and_exact(tree, kind, accuracy)), 99) <= accuracy


@pytest.mark.parametrize("leaves", [2, 6, 37, 1000])
@pytest.mark.parametrize("largest", [2, 7, 128])
def test_roots_have_each_leaf_once_and_the_nodes_above_come_after_their_children(leaves, largest):
    skip, first, count, _ = preorder(leaves)
    roots, upper = divided(skip, count, largest)
    assert sorted(leaf for k in roots for leaf in range(first[k], first[k] + count[k])) == list(range(leaves))
    below = [k for root in roots for k in range(root, skip[root])]
    assert sorted([*below, *upper]) == list(range(len(skip)))
    assert (np.diff(upper) < 0).all()
