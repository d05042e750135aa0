"""Gravity by a tree: forces against the direct sum in NumPy in difficult cases; bits, energy, refusals."""

import numpy as np
import pytest
import taichi as ti
from made_trees import Tree, direct, errors, tree_fixtures

from mpp_taichi.device import backends
from mpp_taichi.errors import BackendError, PrecisionError, SceneError
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.forces.newtonian_gravity import NewtonianGravity
from mpp_taichi.neighbors.tree_estimate import GROUP
from mpp_taichi.neighbors.tree_gather import TreeGather
from mpp_taichi.neighbors.tree_nodes import preorder
from mpp_taichi.neighbors.tree_order import TreeOrder
from mpp_taichi.neighbors.tree_walk import TreeWalk
from mpp_taichi.scene.estimate import estimate
from mpp_taichi.scene.load import load_scene
from mpp_taichi.simulation.simulation import Simulation

COUNT = 6000
SAMPLE = 400  # bodies whose force is summed in NumPy; the 99th percentile is then the fourth largest error
fresh_runtime, trees, tree = tree_fixtures(COUNT)


def bodies(kind, count=COUNT, seed=1):
    """Positions and masses, which sum up to 1, of a distribution that a tree is used for."""
    random = np.random.default_rng(seed)
    direction = random.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    mass = 0.5 + random.random(count)
    if kind == "sphere":
        position = direction * random.random(count)[:, None] ** (1 / 3)
    elif kind == "plummer":
        position = direction / np.sqrt(random.random(count) ** (-2 / 3) - 1.0)[:, None]
    elif kind == "disc":  # thin
        angle, radius = 2.0 * np.pi * random.random(count), np.sqrt(random.random(count))
        position = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.01 * random.normal(size=count)], 1)
    elif kind == "ring":  # thin, around a body of a hundred times its mass
        angle, radius = 2.0 * np.pi * random.random(count), np.sqrt(1.0 + 3.0 * random.random(count))
        position = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.01 * random.normal(size=count)], 1)
        position[0], mass[0] = 0.0, 100.0 * mass.sum()
    else:  # clumps a hundred to a thousand times smaller than their distances, some of them within one group of bodies
        clump, size = random.integers(0, 40, count), 10 ** random.uniform(-4.0, -1.5, 40)
        position = random.random((40, 3))[clump] + size[clump][:, None] * random.normal(size=(count, 3))
    return position, mass / mass.sum()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["sphere", "plummer", "disc", "ring", "clumps"])
def test_99_of_100_forces_keep_the_accuracy(tree, kind):
    position, mass = bodies(kind)
    rows = np.random.default_rng(2).choice(COUNT, SAMPLE, replace=False)
    exact, well = direct(position, mass, rows)
    medians = []
    for accuracy in (1e-2, 1e-3, 1e-4, 1e-5):
        tree.place(position, mass, accuracy)
        found = errors(tree.accelerations()[rows], exact)
        assert np.percentile(found, 99) <= accuracy
        medians.append(np.median(found))
        # Errors of potentials have both signs, and energies are sums of them.
        assert abs(tree.potentials()[rows].sum() / (0.5 * mass[rows] @ well) - 1.0) <= 0.1 * accuracy
    # A tenth of the accuracy is a tolerance of 10^(-3/2) for each node, and errors go with its power 7/10: a factor of 11 each
    # time, until so few bodies are all summed one by one.
    if kind == "sphere":
        assert medians[0] > 5.0 * medians[1] > 25.0 * medians[2] > 125.0 * medians[3]


@pytest.mark.parametrize("kind", ["sphere", "plummer"])
def test_a_softened_node_is_expanded_with_its_softening(tree, kind):
    """ε of the size of the system, where the unsoftened expansion would be wrong by tens of percent."""
    position, mass = bodies(kind)
    rows = np.arange(0, COUNT, 30)
    exact, well = direct(position, mass, rows, softening=0.7)
    tree.place(position, mass, 1e-4, softening=0.7)
    assert np.percentile(errors(tree.accelerations()[rows], exact), 99) <= 1e-4
    np.testing.assert_allclose(tree.potentials()[rows], 0.5 * mass[rows] * well, rtol=1e-4)


def test_the_momentum_of_forces_by_a_tree_is_conserved_to_the_accuracy(tree):
    """Nodes act on bodies and bodies not on nodes: Σ m a is no zero, but errors of many bodies cancel further."""
    position, mass = bodies("plummer")
    found = tree.place(position, mass, 1e-3).accelerations()
    assert 0.0 < np.linalg.norm(mass @ found) < 1e-3 * (mass @ np.linalg.norm(found, axis=1))


def test_bodies_at_one_place_and_without_mass(tree):
    """300 bodies at one place fill groups of their own, softened; the massless feel the others alone."""
    position, mass = bodies("sphere")
    position[:300], mass[200:900] = position[0], 0.0
    rows = np.arange(0, COUNT, 20)
    exact, _ = direct(position, mass, rows, softening=0.1)
    found = tree.place(position, mass, 1e-4, softening=0.1).accelerations()
    assert np.percentile(errors(found[rows], exact), 99) <= 1e-4
    np.testing.assert_array_equal(tree.place(position, 0.0 * mass, softening=0.1).accelerations(), 0.0)


def test_a_body_far_out_does_not_blur_the_others(tree):
    """At 10⁶ radii all others would share one cell of the curve's 2^20 and be in no order, were the frame not limited."""
    position, mass = bodies("sphere")
    position[7] *= 1e6
    found = tree.place(position, mass, 1e-3).accelerations()
    rows = np.arange(0, COUNT, 30)
    exact, _ = direct(position, mass, rows)
    assert np.percentile(errors(found[rows], exact), 99) <= 1e-3
    # Nine in ten leaves: 16 of 6000 bodies in a sphere of radius 1 fill a cube of the edge 0.22, and lie in few more than one.
    boxes = tree.sum.nodes.box.to_numpy().reshape(-1, 2, 3) * tree.sum.order.length
    widths = np.ptp(boxes[tree.sum.nodes.leaves.to_numpy() == 1], axis=1).max(1)
    assert np.percentile(widths, 90) < 0.6


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_place_that_is_no_number_is_found(tree, bad):
    position, mass = bodies("sphere")
    position[123, 1] = bad
    tree.place(position, mass)
    assert np.isnan(tree.accelerations()).all()
    assert np.isnan(tree.potentials()).all()


def test_equal_keys_stay_in_the_order_of_the_scene(tree):
    places = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])[np.arange(COUNT) * 7 % 11 // 6]
    tree.place(places, np.ones(COUNT), softening=0.1).accelerations()
    found = tree.sum.order.order.to_numpy()
    assert np.count_nonzero(np.diff(found) < 0) == 1  # two places, each in the order of its bodies


@pytest.mark.sampled(3)
def test_in_the_plane_gravity_still_falls_off_with_the_square(tree):
    position, mass = bodies("sphere", 2000)
    flat = np.ascontiguousarray(position[:, :2])
    rows = np.arange(0, 2000, 10)
    exact, well = direct(flat, mass, rows)
    plane = Tree(2000, 2).place(flat, mass, 1e-3)
    assert np.percentile(errors(plane.accelerations()[rows], exact), 99) <= 1e-3


@pytest.mark.parametrize("count", [2, 100])
@pytest.mark.sampled(3)
def test_few_bodies_are_summed_pair_by_pair(tree, count):
    """Up to a group nothing is far; beyond, the tightest accuracy leaves 1e-6."""
    position, mass = bodies("sphere", count)
    exact, well = direct(position, mass, np.arange(count))
    few = Tree(count).place(position, mass, 1e-6)
    tolerance = 1e-13 if count <= GROUP else 1e-6
    np.testing.assert_allclose(few.accelerations(), exact, rtol=0, atol=tolerance * np.linalg.norm(exact, axis=1).max())
    np.testing.assert_allclose(few.potentials(), 0.5 * mass * well, rtol=tolerance)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_neighbours_on_the_curve_are_neighbours_in_space(tree, dimensions):
    """Hilbert's curve goes from cell to adjacent cell; any error in the index makes it jump."""
    side = {2: 32, 3: 16}[dimensions]
    cells = np.stack(np.meshgrid(*[np.arange(side)] * dimensions, indexing="ij"), -1).reshape(-1, dimensions)
    cells = np.random.default_rng(3).permutation(cells)
    count = len(cells)
    position, mass = ti.Vector.field(dimensions, float, count), ti.field(float, count)
    position.from_numpy(cells.astype(float))
    mass.fill(1.0)
    order = TreeOrder(count, count, dimensions, on_cpu=True)
    assert order.build(position, mass)
    path = cells[order.order.to_numpy()]
    assert len(np.unique(path, axis=0)) == count
    # The outermost bodies lie on the frame's edge, so that the curve's 2^20 cells refine those of the grid: one step each.
    assert np.abs(np.diff(path, axis=0)).sum(1).max() == 1


@pytest.mark.sampled(2)
@pytest.mark.parametrize("leaves", [1, 2, 3, 5, 8, 37])
def test_every_leaf_is_reached_once(leaves):
    skip, first, count, levels = preorder(leaves)
    assert len(skip) == 2 * leaves - 1
    assert sorted(np.concatenate(levels)) == list(range(2 * leaves - 1))
    node, seen = 0, []
    while node < len(skip):  # a walk that opens every other node it meets
        opens = node % 2 == 0 and count[node] > 1
        if not opens:
            seen += range(first[node], first[node] + count[node])
        node = node + 1 if opens else skip[node]
    assert seen == list(range(leaves))


def test_a_tree_sums_nothing_beside_others(tree):
    with pytest.raises(TypeError, match="sums only gravity"):
        TotalForce((tree.force, NewtonianGravity(strength=1.0)), 10, 3)


# Other devices ------------------------------------------------------------------------------------------------------------


def test_the_bits_do_not_depend_on_the_threads():
    position, mass = bodies("plummer")
    found = []
    for threads in (1, 3):
        backends.start("cpu", "f64", threads=threads)
        tree = Tree(COUNT).place(position, mass)
        found.append((tree.accelerations(), tree.potentials()))
        backends.stop()
    for other in found[1:]:
        np.testing.assert_array_equal(other[0], found[0][0])
        np.testing.assert_array_equal(other[1], found[0][1])


@pytest.mark.sampled(3)
def test_any_units_will_do():
    """Second moments in SI units are beyond f32: only a tree in units of its own has them."""
    backends.start("cpu", "f32", threads=2)
    position, mass = bodies("sphere")
    rows = np.arange(0, COUNT, 30)
    tree = Tree(COUNT)
    for length, weight, strength in ((1.0, 1.0, 1.0), (1e11, 1e30, 6.67e-11), (1e-7, 1e-12, 1.0)):
        x, m = (position * length).astype(np.float32), (mass * weight).astype(np.float32)
        exact, _ = direct(x / float(length), m / float(weight), rows)
        found = tree.place(x, m, 1e-3, strength=strength).accelerations()[rows].astype(float)
        assert np.percentile(errors(found / (strength * weight / length**2), exact), 99) <= 1e-3


@pytest.mark.sampled(3)
def test_a_thread_for_each_body_sums_what_groups_of_them_do():
    """The walk of GPUs, here on the CPU: the same nodes in another order, so the same but for rounding."""
    backends.start("cpu", "f64", threads=2)
    position, mass = bodies("plummer")
    tree = Tree(COUNT).place(position, mass, softening=0.01)
    tree.sum.walk = TreeWalk(tree.sum.order, tree.sum.nodes, tree.sum.estimate)
    together = tree.accelerations(), tree.potentials()
    tree.sum.walk = TreeGather(tree.sum.order, tree.sum.nodes, tree.sum.estimate)
    size = np.linalg.norm(together[0], axis=1)[:, None]
    # Sums of some hundred terms, each rounded by some 2^-53.
    assert np.max(np.abs(tree.accelerations() - together[0]) / size) < 1e-12
    np.testing.assert_allclose(tree.potentials(), together[1], rtol=1e-12)


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_software_vulkan_keeps_the_accuracy(software_vulkan, precision):
    """Vulkan has no exponentials and powers in f64, which a kernel of the check of the accuracy takes."""
    backends.start("vulkan", precision)
    position, mass = (array.astype(np.float32).astype(float) for array in bodies("plummer", 1500))
    rows = np.arange(0, 1500, 10)
    exact, _ = direct(position, mass, rows)
    found = Tree(1500).place(position, mass, 1e-3).accelerations()[rows].astype(float)
    assert np.percentile(errors(found, exact), 99) <= 1e-3


# Whole scenes -------------------------------------------------------------------------------------------------------------


def scene(solver="tree", count=1500, *, integrator="leapfrog", steps=40, **more):
    gravity = {"strength": 1.0, "softening": 0.05, "solver": solver}
    return {
        "seed": 4,
        "particles": [{"plummer": {"count": count, "total_mass": 1.0, "scale_radius": 1.0}}],
        "forces": [{"newtonian_gravity": gravity | more.pop("gravity", {})}],
        "integrator": {integrator: {"dt": 0.02}},
        "run": {"steps": steps},
        **more,
    }


@pytest.mark.sampled(3)
def test_a_cluster_keeps_its_energy_as_with_the_direct_sum():
    """Both begin with the same energy to the tree's error of the potential, and then wobble alike."""
    found = {}
    for solver in ("direct", "tree"):
        with Simulation(scene(solver), backend="cpu", precision="f64", threads=2) as simulation:
            energies = []
            for _ in range(2):
                facts = simulation.phase.energy_meter.mechanics(simulation.snapshot(), simulation.time)
                energies.append(facts["total_energy"])
                simulation.run()
            found[solver] = np.array(energies), simulation.plan
    (exact, _), (near, plan) = found["direct"], found["tree"]
    assert plan == "parallel"
    # 1e-3 of a force is 1e-3 of a potential at most, and those of 1500 bodies have both signs: 1e-3/√1500 of the sum.
    np.testing.assert_allclose(near, exact, rtol=3e-5)


@pytest.mark.sampled(3)
def test_the_great_ring_runs(request):
    """The scene of a million particles, with fewer; its own expectation holds."""
    path = request.config.root_folder / "scenes" / "large" / "great_ring.yaml"
    assert estimate(load_scene(path)).particle_count == 1_000_001
    with Simulation(path, backend="cpu", precision="f64", threads=2, overrides=["constants.count=5000"]) as simulation:
        before = simulation.phase.energy_meter.mechanics(simulation.snapshot(), simulation.time)["total_energy"]
        simulation.run()
        after = simulation.phase.energy_meter.mechanics(simulation.snapshot(), simulation.time)["total_energy"]
    assert abs(after / before - 1.0) < 1e-5


@pytest.mark.sampled(3)
def test_held_axes_stay():
    held = {"body": {"mass": 0.1, "position": [3, 0, 0], "free": [False, True, False]}}
    changed = scene(steps=5)
    changed["particles"].append(held)
    with Simulation(changed, backend="cpu", precision="f64", threads=2) as simulation:
        simulation.run()
        place = simulation.snapshot().position[-1]
    assert place[0] == 3.0 and place[2] == 0.0 and place[1] != 0.0


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"integrator": {"hermite4": {"dt": 0.01}}}, "tree sums accelerations for steps of equal length, not for hermite4"),
        ({"integrator": {"ias15": {"dt": 0.01}}}, "not for ias15"),
        ({"integrator": {"chin4a": {"dt": 0.01}}}, "not for chin4a"),
        ({"integrator": {"implicit_midpoint": {"dt": 0.01}}}, "not for implicit_midpoint"),
        ({"gravity": {"accuracy": 1e-9}}, "accuracy"),
        ({"gravity": {"solver": "direct", "accuracy": 1e-3}}, "the direct sum has none to choose"),
        ({"gravity": {"solver": "treee"}}, "tree"),
    ],
)
def test_what_a_tree_does_not_go_with_is_said(change, text):
    changed = scene(gravity=change.get("gravity", {}))
    with pytest.raises(SceneError, match=text):
        load_scene(changed | {key: value for key, value in change.items() if key != "gravity"})


def test_other_pair_forces_are_refused():
    changed = scene()
    changed["forces"].append({"coulomb": {"coulomb_constant": 1.0}})
    with pytest.raises(SceneError, match="tree sums only gravity, not beside coulomb"):
        load_scene(changed)


def test_plans_and_precisions_without_a_tree_are_refused():
    for options, error, text in (
        ({"plan": "serial"}, BackendError, "only the parallel plan"),
        ({"precision": "ds"}, PrecisionError, "solver: tree"),
    ):
        with pytest.raises(error, match=text):
            Simulation(scene(), backend="cpu", **options)


def test_a_million_bodies_are_allowed_their_work():
    by_tree, by_pairs = (estimate(load_scene(scene(solver, count=1_000_000))) for solver in ("tree", "direct"))
    assert by_tree.pair_interactions_per_evaluation < 1e10
    assert by_pairs.pair_interactions_per_evaluation == 1_000_000 * 999_999
    assert by_tree.bytes > by_pairs.bytes
