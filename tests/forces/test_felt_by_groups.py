"""Uniform gravity and drag that a group feels, and no other particle."""

import numpy as np
import pytest
from repeated_runs import assert_copies_have_the_bits_of

from mpp_taichi import SceneError, Simulation
from mpp_taichi.compare.numpy_reference import KNOWN_FORCES
from mpp_taichi.scene.load import load_scene

G = [0.5, -1.0, 0.25]


def scene(force, method="leapfrog", **more):
    """Three particles; the second and the third are the group that feels a force."""
    bodies = [{"body": {"name": "alone", "mass": 1, "position": [0, 0, 0], "velocity": [1, 0, 0]}}]
    bodies.append(
        {"lattice": {"name": "pair", "shape": [2], "lower": [1, 1, 1], "upper": [2, 1, 1], "mass": 2, "velocity": [1, 0, 0]}}
    )
    return {"particles": bodies, "forces": force, "integrator": {method: {"dt": 0.01}}} | more


@pytest.mark.parametrize("precision", ["f64", "f32", "ds", "df64"])
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_gravity_pulls_its_group_alone_and_has_its_energy(precision, plan):
    with Simulation(
        scene([{"uniform_gravity": {"acceleration": G, "on": "pair"}}]), backend="cpu", precision=precision, plan=plan
    ) as run:
        before = run.mechanics()
        found = run.run(steps=100)
        v, after = found.snapshot().velocity, run.mechanics()
    eps = 1e-13 if precision in ("f64", "df64") else 100 * 1.2e-7
    assert v == pytest.approx(np.array([[1, 0, 0], *[np.add([1, 0, 0], G)] * 2]), abs=eps)
    change = after["total_energy"] - before["total_energy"]
    assert abs(change) < 10 * eps * after["kinetic_energy"]
    assert after["potential_energy"] != 0.0


@pytest.mark.parametrize("method", ["leapfrog", "implicit_midpoint", "rk4"])
def test_drag_brakes_its_group_alone(method):
    with Simulation(
        scene([{"linear_drag": {"coefficient": 1.0, "on": "pair"}}], method), backend="cpu", precision="f64"
    ) as run:
        run.keep_energy_balance()
        found = run.run(steps=100)
        v, balance = found.snapshot().velocity[:, 0], run.diagnostics()
    assert v == pytest.approx([1.0, *[np.exp(-0.5)] * 2], rel=1e-5)  # (c dt/m)²/24 of 0.5
    assert balance["dissipated_energy"] == pytest.approx(2 * (1 - np.exp(-1.0)), rel=1e-4)


def test_derivatives_of_a_field_that_a_group_feels():
    with Simulation(
        scene([{"uniform_gravity": {"acceleration": G, "on": "pair"}}], "hermite4"), backend="cpu", precision="f64"
    ) as run:
        assert run.run(steps=50).snapshot().velocity[2] == pytest.approx(np.add([1, 0, 0], np.multiply(0.5, G)), abs=1e-13)


def test_copies_and_their_lanes_have_the_bits_of_a_single_run():
    forces = [{"uniform_gravity": {"acceleration": G, "on": "pair"}}, {"linear_drag": {"coefficient": 0.3, "on": "alone"}}]
    with Simulation(scene(forces), backend="cpu", precision="f64") as run:
        single = run.run(steps=40).snapshot()
    assert_copies_have_the_bits_of(single, scene(forces), copies=9, steps=40)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"integrator": {"taylor": {"dt": 0.1}}}, "takes forces on all bodies .* not uniform_gravity with on:"),
        (
            {"integrator": {"event_driven": {"dt": 0.1}}, "contacts": {"hard_spheres": {"solver": "event_driven"}}},
            "knows no force but uniform_gravity, of every particle",
        ),
        ({"forces": [{"uniform_gravity": {"on": "stranger"}}]}, "stranger"),
    ],
)
def test_what_needs_a_field_of_every_particle_refuses_it(more, message):
    with pytest.raises(SceneError, match=message):
        load_scene(scene([{"uniform_gravity": {"acceleration": G, "on": "pair"}}]) | more)


def test_the_reference_of_compare_does_not_take_a_part_for_the_whole():
    assert "on" not in KNOWN_FORCES["uniform_gravity"] and "on" not in KNOWN_FORCES["linear_drag"]
