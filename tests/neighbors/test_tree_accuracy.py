"""The accuracy of gravity by a tree where pulls cancel, or lengths or masses differ by many powers of ten."""

import sys

import numpy as np
import pytest
import taichi as ti
from conftest import ROOT
from made_trees import Tree, tree_fixtures

from mpp_taichi.device import backends
from mpp_taichi.neighbors.tree_gather import TreeGather
from mpp_taichi.neighbors.tree_order import TreeOrder

sys.path[:0] = [str(ROOT / "tools" / "benchmarks")]

from tree_bodies import KINDS, bodies, exact  # noqa: E402

COUNT = 4913  # 17³
fresh_runtime, trees, tree = tree_fixtures(COUNT)
SAMPLE = 500
ACCURACIES = (1e-2, 1e-3, 1e-4, 1e-5)
UNIT = {"f32": (np.float32, 2.0**-24), "f64": (np.float64, 2.0**-53)}  # type and unit round-off u
ROUNDINGS = 32.0
"""The round-off of a force in units of u Σ_j |a_ij| (docs/gravity.md): a tree adds up 1024 pulls one after another, and the
roundings of 1024 additions, of any sign, add up to √1024 roundings."""


def placed(tree, kind, accuracy, precision="f64"):
    """A tree of a distribution, and the relative errors of the forces on some of its bodies, beyond round-off."""
    dtype, unit = UNIT[precision]
    position, mass = bodies(kind, tree.count, dtype)
    rows = np.random.default_rng(2).choice(tree.count, SAMPLE, replace=False)
    acceleration, strength = exact(position[:, : tree.dimensions], mass, rows)
    found = tree.place(position[:, : tree.dimensions], mass, accuracy).accelerations()[rows].astype(float)
    error = np.linalg.norm(found - acceleration, axis=1) - ROUNDINGS * unit * strength
    return np.maximum(error, 0.0) / np.linalg.norm(acceleration, axis=1)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tree", UNIT, indirect=True)
def test_99_of_100_forces_keep_the_accuracy_also_where_pulls_cancel(tree, kind, request):
    precision = request.node.callspec.params["tree"]
    for accuracy in ACCURACIES:
        assert np.percentile(placed(tree, kind, accuracy, precision), 99) <= accuracy


@pytest.mark.sampled(3)
def test_in_two_dimensions_forces_keep_the_accuracy_where_pulls_cancel():
    backends.start("cpu", "f64", threads=2)
    plane = Tree(COUNT, 2)
    for kind in ("row", "grid"):
        for accuracy in ACCURACIES:
            assert np.percentile(placed(plane, kind, accuracy), 99) <= accuracy


@pytest.mark.sampled(6)
def test_a_thread_for_each_body_keeps_the_accuracy_where_pulls_cancel():
    """The walk of GPUs, here on the CPU."""
    backends.start("cpu", "f64", threads=2)
    tree = Tree(COUNT)
    tree.sum.walk = TreeGather(tree.sum.order, tree.sum.nodes, tree.sum.estimate)
    for accuracy in ACCURACIES:
        assert np.percentile(placed(tree, "row", accuracy), 99) <= accuracy


@pytest.mark.sampled(3)
def test_software_vulkan_keeps_the_accuracy_where_pulls_cancel(software_vulkan):
    backends.start("vulkan", "f32")
    tree = Tree(2000)
    for kind in ("row", "grid", "shell"):
        assert np.percentile(placed(tree, kind, 1e-2, "f32"), 99) <= 1e-2


def walks(tree, monkeypatch):
    """The number of walks of one force."""
    run, count = tree.sum.walk.run, []
    monkeypatch.setattr(tree.sum.walk, "run", lambda *numbers, **names: (count.append(1), run(*numbers, **names)))
    tree.accelerations()
    return len(count)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["sphere", "plummer", "clusters", "heavy"])
def test_bodies_whose_pulls_do_not_cancel_walk_once(tree, kind, monkeypatch):
    position, mass = bodies(kind, COUNT, np.float64)
    for accuracy in ACCURACIES:
        tree.place(position, mass, accuracy)
        with monkeypatch.context() as patch:
            assert walks(tree, patch) == 1


def test_where_all_pulls_cancel_only_round_off_is_left(tree, monkeypatch):
    """Massless bodies in the middle of mirrored bodies: without any acceleration, no error is small enough, but walks end."""
    pairs, middle = 2300, slice(4600, COUNT)
    position, mass = bodies("sphere", COUNT, np.float64)
    position[pairs : 2 * pairs], mass[pairs : 2 * pairs] = -position[:pairs], mass[:pairs]
    position[middle], mass[middle] = 0.0, 0.0
    tree.place(position, mass, 1e-3, softening=0.1)
    assert walks(tree, monkeypatch) > 1
    distance = np.sqrt((position**2).sum(1) + 0.1**2)
    strength = (mass / distance**3) @ np.linalg.norm(position, axis=1)
    found = np.linalg.norm(tree.accelerations()[middle], axis=1)
    assert found.max() <= ROUNDINGS * 2.0**-53 * strength


@pytest.mark.parametrize("kind", ["row", "shell"])
def test_energies_are_sums_over_the_same_nodes_as_forces(tree, kind):
    position, mass = bodies(kind, COUNT, np.float64)
    tree.place(position, mass, 1e-3).accelerations()
    alone = tree.sum.walk.total.to_numpy()
    terms = tree.potentials()
    np.testing.assert_array_equal(tree.sum.walk.total.to_numpy(), alone)
    rows = np.arange(0, COUNT, 50)
    for i in rows:
        others = np.delete(mass, i) / np.linalg.norm(np.delete(position, i, 0) - position[i], axis=1)
        assert terms[i] == pytest.approx(-0.5 * mass[i] * others.sum(), rel=1e-3)


@pytest.mark.sampled(3)
def test_the_frame_of_a_tree_changes_no_separation():
    """In f32, a subtraction of the mean would round the places of a row by a part of its spacing."""
    backends.start("cpu", "f32", threads=2)
    position, mass = ti.Vector.field(3, float, 1000), ti.field(float, 1000)
    mass.fill(1.0)
    order = TreeOrder(1000, 1024, 3, on_cpu=True)
    for shift in (0.0, 3.0, 1000.0):
        places = np.zeros((1000, 3), np.float32)
        places[:, 0] = np.arange(1000) / np.float32(1000.0) + np.float32(shift)
        places[:, 1] = np.random.default_rng(4).normal(size=1000) ** 9
        position.from_numpy(places)
        assert order.build(position, mass)
        frame = order.position.to_numpy().reshape(3, -1)[:, :1000].T.astype(float)
        moved = places[order.order.to_numpy()].astype(float) - frame * order.length
        assert (np.ptp(moved, axis=0) == 0.0).all()
        assert abs(frame).max() <= 1.0
