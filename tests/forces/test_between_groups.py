"""Forces between groups and on groups: the pairs that act are those that a matrix of pairs says, in every loop and number."""

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation
from mpp_taichi.compare.numpy_reference import NumpyForces, bodies
from mpp_taichi.scene.load import load_scene

COUNTS = {"g": 7, "h": 9}
GROUPS = {"g": range(7), "h": range(7, 16), "g[0:2]": range(2), "g[1]": range(1, 2)}
CASES = [("g", "h"), ("g", "g"), ("g[0:2]", "g"), ("g[1]", "h"), ("g[1]", "g[0:2]")]
LAWS = {
    "log": {"pair": {"potential": "0.3*m1*m2*log(r)"}},
    "gravity": {"newtonian_gravity": {"strength": 0.3, "softening": 0.2}},
}
SHAPES = {"log": lambda r: -0.3 / r**2, "gravity": lambda r: -0.3 / (r**2 + 0.04) ** 1.5}
"""The force on i along x_i − x_j, over the product of masses."""


def scene_of(force, between, method="leapfrog", more=()):
    random = np.random.default_rng(4)
    particles = []
    for name, count in COUNTS.items():
        low = random.uniform(-2, -1, 3).tolist()
        high = random.uniform(1, 2, 3).tolist()
        particles.append(
            {"gas": {"name": name, "count": count, "lower": low, "upper": high, "radius": 0.05, "speed": 0.3, "mass": 1.5}}
        )
    (name, given), *_ = force.items()
    entry = {name: {**given, **({} if between is None else {"between": list(between)})}}
    return {
        "particles": particles,
        "forces": [entry, *more],
        "seed": 7,
        "integrator": {method: {"dt": 0.01}},
        "run": {"duration": 0.3},
    }


def by_matrix(law, start, between):
    """Accelerations by a matrix of the pairs that act."""
    first, second = (np.isin(np.arange(start.particle_count), GROUPS[name]) for name in between)
    act = np.outer(first, second) | np.outer(second, first)
    np.fill_diagonal(act, False)
    away = start.position[:, None] - start.position[None]
    distance = np.linalg.norm(away, axis=2) + np.eye(start.particle_count)
    force = (act * np.outer(start.mass, start.mass) * SHAPES[law](distance))[..., None] * away
    return force.sum(1) / start.mass[:, None]


@pytest.mark.parametrize("between", CASES, ids="-".join)
@pytest.mark.parametrize("law", LAWS)
def test_the_pairs_that_act_are_those_of_the_matrix(law, between):
    spec = load_scene(scene_of(LAWS[law], between))
    with Simulation(spec, backend="cpu", precision="f64") as simulation:
        start = simulation.start
        found = simulation.accelerations()
        expected = by_matrix(law, start, between)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * max(1.0, np.abs(expected).max()))
        np.testing.assert_allclose(start.mass @ found, 0.0, atol=1e-13 * np.abs(expected).sum())
    reference = NumpyForces(spec, bodies(start, 3, ["f64"]))
    judged = reference.acceleration(start.position[None], start.velocity[None])[0]
    np.testing.assert_allclose(judged, expected, rtol=0, atol=1e-13 * max(1.0, np.abs(expected).max()))


def end_of(between, method="leapfrog", **device):
    with Simulation(scene_of(LAWS["log"], between, method), **device) as simulation:
        energy = simulation.mechanics()["total_energy"]
        simulation.run()
        return simulation.snapshot().position, simulation.mechanics()["total_energy"] - energy


@pytest.mark.parametrize("between", CASES[:3], ids="-".join)
@pytest.mark.parametrize(
    ("device", "allowed"),
    [
        ({"backend": "cpu", "plan": "parallel"}, 1e-12),
        ({"backend": "cpu", "precision": "f32"}, 1e-5),
        ({"backend": "cpu", "precision": "f32", "plan": "parallel"}, 1e-5),
        ({"backend": "vulkan", "precision": "f32"}, 1e-5),
        ({"backend": "vulkan", "precision": "f32", "plan": "parallel"}, 1e-5),
    ],
    ids=str,
)
@pytest.mark.sampled(3)
def test_every_plan_and_device_agrees(between, device, allowed, request):
    """Thirty steps round places of 2 by 2⁻²⁴ each some ten times, at random."""
    if device["backend"] == "vulkan":
        request.getfixturevalue("software_vulkan")
    expected, _ = end_of(between, backend="cpu", precision="f64")
    found, _ = end_of(between, **device)
    assert np.abs(found - expected).max() < allowed


@pytest.mark.parametrize("method", ["hermite4", "hermite6", "rk4", "dop853"])
@pytest.mark.sampled(2)
def test_methods_agree_and_keep_the_energy(method):
    exact, change = end_of(("g[0:2]", "g"), "ias15", backend="cpu", precision="f64")
    found, _ = end_of(("g[0:2]", "g"), method, backend="cpu", precision="f64")
    assert abs(change) < 1e-12
    assert np.abs(found - exact).max() < 1e-5  # of order four and more, with steps of a hundredth of the motion's time


def test_arithmetic_between_groups_runs_in_double_single_numbers():
    scene = scene_of(LAWS["gravity"], ("g", "h"))
    ends = []
    for precision in ("f64", "df64"):
        with Simulation(scene, backend="cpu", precision=precision) as simulation:
            simulation.run()
            ends.append(simulation.snapshot().position)
    assert np.abs(ends[1] - ends[0]).max() < 1e-11


def test_a_field_acts_on_its_group_alone():
    field = {"external": {"potential": "m*(x^2 + sin(y))", "on": "h"}}
    spec = load_scene(scene_of(LAWS["log"], ("g", "g"), more=[field]))
    with Simulation(spec, backend="cpu", precision="f64") as simulation:
        start, found = simulation.start, simulation.accelerations()
        energy = simulation.mechanics()["total_energy"]
    x, y = start.position[:, 0], start.position[:, 1]
    expected = by_matrix("log", start, ("g", "g"))
    expected[7:, 0] -= 2.0 * x[7:]
    expected[7:, 1] -= np.cos(y[7:])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)
    reference = NumpyForces(spec, bodies(start, 3, ["f64"]))
    assert np.sum(reference.energy(start.position[None], start.velocity[None])) == pytest.approx(energy, rel=1e-13)
    distance = np.linalg.norm(start.position[:7, None] - start.position[None, :7], axis=2)[np.triu_indices(7, 1)]
    by_hand = 0.3 * 1.5**2 * np.log(distance).sum() + 1.5 * np.sum(x[7:] ** 2 + np.sin(y[7:]))
    assert energy == pytest.approx(by_hand + 0.5 * 1.5 * np.sum(start.velocity**2), rel=1e-13)
    np.testing.assert_allclose(
        reference.acceleration(start.position[None], start.velocity[None])[0], expected, rtol=0, atol=1e-13
    )


def test_beyond_a_cutoff_there_is_no_force_and_no_energy():
    law = {"pair": {"potential": "a/r", "parameters": {"a": 2}, "cutoff": "a/4*3"}}
    bodies_at = [0.0, 1.0, 2.6]  # distances 1, 1.6 and 2.6 beside a cutoff of 1.5
    scene = {
        "particles": [{"body": {"mass": 1, "position": [x, 0, 0]}} for x in bodies_at],
        "forces": [law],
        "integrator": {"leapfrog": {"dt": 0.01}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        np.testing.assert_allclose(simulation.accelerations()[:, 0], [-2.0, 2.0, 0.0], rtol=1e-14)
        assert simulation.mechanics()["total_energy"] == pytest.approx(2.0 - 2.0 / 1.5, rel=1e-14)


@pytest.mark.parametrize(
    ("force", "told"),
    [
        ({"pair": {"potential": "1/r", "between": ["g", "missing"]}}, "forces.0..pair.between.1.: .*missing"),
        ({"pair": {"potential": "1/r", "between": ["g"]}}, "must be a list of 2 particles or groups"),
        ({"newtonian_gravity": {"solver": "tree", "between": ["g", "h"]}}, "a tree sums gravity between all bodies"),
        ({"pair": {"potential": "1/r", "cutoff": "2*nothing"}}, "forces.0..pair.cutoff: unknown name 'nothing'"),
        ({"pair": {"potential": "1/r", "cutoff": 0}}, "pair.cutoff: 0 is not allowed, must be above 0"),
        ({"pair": {"potential": "1/r", "cutoff": "r"}}, "pair.cutoff: unknown name 'r'"),
        ({"lennard_jones": {"length": 1, "cutoff": "length - 2"}}, "cutoff: -1 is not allowed"),
    ],
)
def test_faults_are_told(force, told):
    with pytest.raises(SceneError, match=told):
        load_scene({**scene_of(LAWS["log"], None), "forces": [force]})


def test_methods_made_for_all_bodies_refuse_groups():
    scene = scene_of(LAWS["gravity"], ("g", "h"), "wisdom_holman")
    scene["forces"][0]["newtonian_gravity"]["softening"] = 0.0
    with pytest.raises(SceneError, match="takes forces between all bodies .*, not newtonian_gravity with between:"):
        load_scene(scene)


MANY = [("ring", "planet"), ("planet", "ring"), ("ring[0:9]", "ring[4:20]"), ("ring[0:6]", "ring[0:6]")]
RUNS = {
    "planet": range(1),
    "ring": range(1, 81),
    "ring[0:9]": range(1, 10),
    "ring[4:20]": range(5, 21),
    "ring[0:6]": range(1, 7),
}


def many(between, law="gravity", method="leapfrog"):
    """A planet and 80 particles, which act between two groups of them."""
    (name, given), *_ = LAWS[law].items()
    planet = {"name": "planet", "mass": 3.0, "position": [0.1, 0, 0]}
    ring = {"name": "ring", "shape": [80, 1, 1], "lower": [-2, 1, 0.5], "upper": [2, 1, 0.5], "mass": 0.4}
    return {
        "particles": [{"body": planet}, {"lattice": {**ring, "scatter": [0.01, 0.3, 0.3]}}],
        "forces": [{name: {**given, "between": list(between)}}],
        "seed": 3,
        "integrator": {method: {"dt": 0.01}},
        "run": {"duration": 0.3},
    }


@pytest.mark.parametrize("between", MANY, ids="-".join)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("backend, plan", [("cpu", "serial"), ("cpu", "parallel"), ("vulkan", "auto")])
def test_few_pairs_of_many_are_summed_by_themselves(law, between, backend, plan, request, monkeypatch):
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    for name, indices in RUNS.items():
        monkeypatch.setitem(GROUPS, name, indices)
    precision = "f64" if backend == "cpu" else "f32"
    with Simulation(many(between, law), backend=backend, precision=precision, plan=plan) as simulation:
        assert simulation.total_force.pair_solver == "between"
        expected = by_matrix(law, simulation.start, between)
        found = simulation.accelerations()
        energy = simulation.mechanics()["potential_energy"]
    rounding = 1e-13 if precision == "f64" else 2e-5
    np.testing.assert_allclose(found, expected, rtol=0, atol=rounding * np.abs(expected).max())
    with Simulation(many(between, law, "hermite4"), backend="cpu", precision="f64") as direct:
        assert direct.total_force.pair_solver == "direct"
        assert energy == pytest.approx(direct.mechanics()["potential_energy"], rel=1e-12 if precision == "f64" else 1e-5)


def test_plans_give_the_same_bits_between_groups():
    ends = []
    for plan in ("serial", "parallel"):
        with Simulation(many(("planet", "ring")), backend="cpu", precision="f32", plan=plan) as simulation:
            simulation.run(steps=30)
            ends.append(simulation.snapshot().position.tobytes())
    assert ends[0] == ends[1]


@pytest.mark.parametrize("law", LAWS)
def test_a_particle_makes_no_pair_with_itself(law):
    with pytest.raises(SceneError, match=r"between\[1\]: both are particle 1 \(g\[1\]\), which makes no pair"):
        load_scene(scene_of(LAWS[law], ("g[1]", "g[1]")))
