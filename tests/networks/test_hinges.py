"""Hinges: their energy, the frequencies and the sag of beams, and what runs with them."""

from dataclasses import replace

import numpy as np
import pytest
from measured import MadeUpSample
from scipy.spatial.transform import Rotation

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.errors import StabilityError
from mpp_taichi.modes.linear_network import linearise
from mpp_taichi.quantities._base import Setting
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

ROOTS = np.array([1.8751040687, 4.6940911330, 7.8547574382])  # of cos k cosh k = −1
B = 1.3


def beam(n, *, stiffness=None, method=None, dimensions=2, **more):
    """A clamped beam of length 1 and mass 1 with n links."""
    link = {"stiffness": 1e4 * B * n if stiffness is None else stiffness}
    last, before = f"beam[{n - 1}]", f"beam[{n - 2}]"
    lattice = {"name": "beam", "shape": [n], "lower": [0, 0, 0], "upper": [1 - 1 / n, 0, 0], "mass": 1 / n, "fixed": "first"}
    return {
        "dimensions": dimensions,
        "particles": [
            {"lattice": lattice},
            {"body": {"name": "end", "mass": 0.5 / n, "position": [1, 0, 0]}},
            {"body": {"name": "clamp", "mass": 1, "position": [-1 / n, 0, 0], "free": False}},
        ],
        "springs": [
            {"lattice_links": {"of": "beam", **link}},
            {"link": {"between": [last, "end"], **link}},
            {"lattice_hinges": {"of": "beam", "bending_stiffness": B}},
            {"hinge": {"at": last, "between": [before, "end"], "bending_stiffness": B}},
            {"hinge": {"at": "beam[0]", "between": ["clamp", "beam[1]"], "bending_stiffness": 2 * B}},
        ],
        "integrator": {"leapfrog": {"dt": 1e-4}} if method is None else method,
    } | more


def network(scene):
    spec = load_scene(scene)
    return linearise(assemble(spec), dimensions=spec.dimensions)


def test_a_hinge_has_the_energy_and_the_force_of_its_curvature():
    random = np.random.default_rng(5)
    rest = np.array([[0.0, 0, 0], [0.7, 0, 0], [1.8, 0, 0]])
    bodies = [
        {"body": {"name": name, "mass": 1, "position": place.tolist(), "displacement": random.normal(0, 0.4, 3).tolist()}}
        for name, place in zip("abc", rest, strict=True)
    ]
    scene = {
        "particles": bodies,
        "springs": [{"hinge": {"at": "b", "between": ["a", "c"], "bending_stiffness": B}}],
        "integrator": {"leapfrog": {"dt": 1e-3}},
    }
    p, q = 0.7, 1.1

    def energy(x):
        bend = (x[2] - x[1]) / q - (x[1] - x[0]) / p
        return B / (p + q) * (bend @ bend)

    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        x = simulation.snapshot().position
        assert simulation.diagnostics()["potential_energy"] == pytest.approx(energy(x), rel=1e-13)
        step = 1e-5
        for i, k in np.ndindex(3, 3):
            moved = np.zeros((3, 3))
            moved[i, k] = step
            slope = (energy(x + moved) - energy(x - moved)) / (2 * step)  # exact for a quadratic energy, but for rounding
            assert simulation.accelerations()[i, k] == pytest.approx(-slope, abs=1e-9)


def test_a_turned_chain_costs_no_energy():
    scene = {
        "particles": [{"lattice": {"name": "rod", "shape": [9], "lower": [-1, 0, 0], "upper": [1, 0, 0]}}],
        "springs": [{"lattice_hinges": {"of": "rod", "bending_stiffness": B}}],
        "integrator": {"leapfrog": {"dt": 1e-3}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        start = simulation.snapshot()
        turned = start.position @ Rotation.from_rotvec([0.4, 1.1, -0.3]).as_matrix().T + [1.0, 2.0, 3.0]
        moved = start.moved(position=turned, velocity=start.velocity, time=0.0, step=0)
        # Each force is a sum of terms of 2 B n³·0.25 = 42, rounded at places near 3.
        assert np.abs(simulation.accelerations(moved)).max() < 100 * 42 * 4 * np.finfo(float).eps


def test_the_frequencies_of_a_clamped_beam_come_near_to_those_of_euler_and_bernoulli():
    errors = []
    for n in (20, 40):
        net = network(beam(n))
        mass = net.freedom_masses
        found = np.sqrt(np.linalg.eigvalsh(net.stiffness_matrix / np.sqrt(np.outer(mass, mass)))[:3])
        errors.append(found / (ROOTS**2 * np.sqrt(B)) - 1.0)
    assert np.all(np.abs(errors[1]) < [6e-4, 3e-3, 6e-3])
    # Of second order: a quarter of the error, up to the next order, (k/n)² of it.
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_a_clamped_beam_sags_as_beam_theory_says():
    weight = 1e-3  # force per length: w L⁴/8 B at the free end, w L³/6 B the slope there
    errors = []
    for n in (10, 20):
        net = network(beam(n))
        load = np.zeros((len(net.mass), 2))
        load[:, 1] = -weight * net.mass
        sag = net.expand(np.linalg.solve(net.stiffness_matrix, load.ravel()[net.freedoms]))[:, 1]
        errors.append(-sag[n] / (weight / (8.0 * B)) - 1.0)
    assert abs(errors[1]) < 4e-3 and errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("clamped", [True, False])
def test_a_three_dimensional_beam_bends_alike_in_both_directions(clamped):
    net = network(beam(12, dimensions=3))
    mass = net.freedom_masses
    found = np.sqrt(np.linalg.eigvalsh(net.stiffness_matrix / np.sqrt(np.outer(mass, mass))))[:4]
    assert found[0] == pytest.approx(found[1], rel=1e-6) and found[2] == pytest.approx(found[3], rel=1e-6)


METHODS = {
    "velocity_verlet": {"dt": 1e-4},
    "implicit_midpoint": {"dt": 1e-4, "tolerance": 1e-12},
    "energy_momentum": {"dt": 1e-4, "tolerance": 1e-12},
    "hermite4": {"dt": 1e-4},
    "dop853": {"dt": 1e-4},
    "ias15": {"dt": 1e-4},
}


def bent(method="leapfrog", given=None, **more):
    """A beam of eight links that is let go bent."""
    scene = beam(8, stiffness=2e3, **more)
    scene["particles"][0]["lattice"]["displacement"] = [0, "0.2*u^2", 0]
    scene["particles"][1]["body"]["displacement"] = [0, 0.2 * (8 / 7) ** 2, 0]
    scene["integrator"] = {method: given or {"dt": 1e-4}}
    return scene


def end_of(scene, *, backend="cpu", precision="f64", steps=500):
    with Simulation(scene, backend=backend, precision=precision) as simulation:
        simulation.run(steps=steps)
        return simulation.snapshot().position[8]


@pytest.mark.parametrize("method", METHODS)
def test_methods_of_every_kind_bend_a_beam(method):
    wanted = end_of(bent("dop853", {"dt": 5e-5}), steps=1000)
    # ω dt of the fastest vibration is 0.1, of the large motion 0.002: second order is wrong by (ω dt)²/24 of ω t = 50
    # of what little the fast vibrations have.
    assert end_of(bent(method, METHODS[method])) == pytest.approx(wanted, abs=2e-3)


@pytest.mark.parametrize(
    ("backend", "precision", "bound"), [("cpu", "f32", 1e-4), ("vulkan", "f32", 1e-4), ("cpu", "df64", 1e-9)]
)
def test_every_precision_bends_a_beam(backend, precision, bound):
    wanted = end_of(bent())
    assert end_of(bent(), backend=backend, precision=precision) == pytest.approx(wanted, abs=bound)


def test_a_step_that_the_hinges_do_not_allow_is_refused():
    net = network(beam(8, stiffness=2e3))
    mass = net.freedom_masses
    fastest = np.sqrt(np.linalg.eigvalsh(net.stiffness_matrix / np.sqrt(np.outer(mass, mass)))[-1])
    with pytest.raises(StabilityError, match=f"beyond the largest stable step {2.0 / fastest:.6g}"):
        end_of(beam(8, stiffness=2e3, method={"leapfrog": {"dt": 2.02 / fastest}}), steps=1)
    end_of(beam(8, stiffness=2e3, method={"leapfrog": {"dt": 1.98 / fastest}}), steps=1)


@pytest.mark.parametrize("shape", [[2], [3], [4, 3], [1, 5, 4], [3, 3, 3], [2, 2, 2]])
def test_the_number_of_springs_is_known_beforehand(shape):
    lattice = {
        "name": "block",
        "shape": shape,
        "lower": [0, 0, 0],
        "upper": [1.0 if k < len(shape) and shape[k] > 1 else 0.0 for k in range(3)],
    }
    scene = {
        "particles": [{"lattice": lattice}],
        "springs": [{"lattice_hinges": {"of": "block", "bending_stiffness": 1}}],
        "integrator": {"leapfrog": {"dt": 1e-3}},
    }
    from mpp_taichi.scene.layout import build, layout_of

    spec = load_scene(scene)
    counted = build("networks", spec.springs[0]).spring_count(layout_of(spec).lattice)
    assert counted == len(assemble(spec).springs)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"springs": [{"hinge": {"at": "end", "between": ["clamp", "end"], "bending_stiffness": 1}}]}, "must be a third"),
        ({"forces": [{"bond": {"potential": "l^2"}}]}, "cannot be beside bond, which acts along every spring"),
    ],
)
def test_what_has_no_meaning_is_refused(change, message):
    with pytest.raises(SceneError, match=message):
        end_of(beam(4) | change, steps=1)


@pytest.mark.parametrize("places", [(0, 0, 1), (0, 1, 1)])
def test_a_hinge_with_a_link_of_no_length_is_refused(places):
    bodies = [{"body": {"name": name, "mass": 1, "position": [x, 0, 0]}} for name, x in zip("abc", places, strict=True)]
    springs = [{"hinge": {"at": "b", "between": ["a", "c"], "bending_stiffness": B}}]
    with pytest.raises(SceneError, match="a hinge needs three particles at three places"):
        assemble(load_scene({"particles": bodies, "springs": springs, "integrator": {"leapfrog": {"dt": 1e-3}}}))


def test_hinges_beside_springs_that_break_are_refused():
    scene = beam(4)
    scene["springs"][0]["lattice_links"]["breaks_at"] = 0.5
    with pytest.raises(SceneError, match="a hinge needs whole links"):
        end_of(scene, steps=1)


def test_strains_are_those_of_the_links():
    spec = load_scene(beam(4))
    start = assemble(spec)
    strain = component.build("quantities", "spring_strain", {"between": None})
    strain.begin(Setting(spec, start))
    found = strain.each(MadeUpSample(replace(start, position=1.5 * start.position)))
    assert found == pytest.approx(np.full(4, 0.5))
