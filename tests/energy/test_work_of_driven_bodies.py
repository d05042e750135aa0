"""The work of the agents that move bodies on given paths: the residual of the energy balance has the order of the method."""

import math

import numpy as np
import pytest
from test_driven_bodies import shaken
from test_integrators import declared

from mpp_taichi import Simulation

FORCES = {
    "fields": [{"uniform_gravity": {"acceleration": [0, 0.2, -0.3]}}, {"linear_drag": {"coefficient": 0.2}}],
    "formulas": [
        {"external": {"potential": "m*(x^2 + 2*y^2 + z^2)/2 + q*sin(x)"}},
        {"pair": {"potential": "q1*q2*exp(-r/2)", "softening": 0.4}},
    ],
    "groups": [{"coulomb": {"coulomb_constant": 0.7, "softening": 0.2, "between": ["support", "weight"]}}],
    "magnetic": [{"magnetic_field": {"field": [0, 0, 2.0]}}],
}


def residual(name, dt, forces=(), plan="auto", time=1.6):
    scene = shaken(name, dt, forces=forces, damping=0.4 if declared(name, "takes_velocity") else 0.0)
    for number, entry in enumerate(scene["particles"]):
        entry["body"]["charge"] = (0.5, -0.7, 1.1, 0.3)[number]
    with Simulation(scene, backend="cpu", plan=plan) as simulation:
        simulation.keep_energy_balance()
        simulation.run(steps=round(time / dt))
        found = simulation.diagnostics()
    return abs(found["energy_balance_residual"]), found


@pytest.mark.parametrize("kind", FORCES)
@pytest.mark.parametrize("name", ["leapfrog", "yoshida4"])
def test_the_residual_has_the_order_of_the_method(name, kind):
    errors = [residual(name, dt, FORCES[kind])[0] for dt in (0.04, 0.02)]
    assert np.log2(errors[0] / errors[1]) > declared(name, "order") - 0.3, errors
    assert errors[1] < (2e-3 if name == "leapfrog" else 2e-5), errors


def test_a_scene_with_paths_turns_over_much_more_energy_than_the_residual():
    _, found = residual("yoshida4", 0.01)
    assert abs(found["work"]) > 0.1
    assert abs(found["energy_balance_residual"]) < 1e-6 * found["energy_turnover"]


def test_both_plans_book_the_same_work():
    serial, parallel = (residual("leapfrog", 0.02, FORCES["fields"], plan)[1] for plan in ("serial", "parallel"))
    assert math.isclose(serial["work"], parallel["work"], rel_tol=1e-12)


def test_the_work_on_a_lonely_body_is_the_change_of_its_energy():
    """A mass on a path in uniform gravity: the agent gives kinetic and potential energy, W = ½ m v² + m g z − ½ m v₀²."""
    scene = {
        "particles": [{"body": {"mass": 2.0, "path": ["0", "0", "t^2 - t"]}}, {"body": {"mass": 1.0, "position": [1, 0, 0]}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -9.81]}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
    }
    with Simulation(scene, backend="cpu") as simulation:
        simulation.keep_energy_balance()
        simulation.run(steps=300)
        found = simulation.diagnostics()
    time = 3.0
    expected = (2 * time - 1) ** 2 + 2.0 * 9.81 * (time**2 - time) - 1.0
    assert math.isclose(found["work"], expected, rel_tol=1e-9)


def test_a_body_without_mass_does_the_work_of_its_springs():
    scene = {
        "particles": [
            {"body": {"mass": 0.0, "path": ["0.2*sin(3*t)", "0", "0"]}},
            {"body": {"mass": 1.0, "position": [1.0, 0, 0]}},
        ],
        "springs": [{"link": {"between": [0, 1], "stiffness": 20.0}}],
        "integrator": {"yoshida4": {"dt": 0.01}},
    }
    with Simulation(scene, backend="cpu") as simulation:
        simulation.keep_energy_balance()
        simulation.run(steps=200)
        found = simulation.diagnostics()
    assert abs(found["work"]) > 0.01
    assert abs(found["energy_balance_residual"]) < 1e-5 * found["energy_turnover"]


def test_a_planet_on_a_given_orbit_is_worked_on_through_its_tree_too():
    """The tree sums the forces of the step, the direct sum the power: the residual is an error of the tree."""
    scene = shaken("leapfrog", 0.02, damping=0.0)
    scene["forces"] = [{"newtonian_gravity": {"strength": 0.5, "softening": 0.3, "solver": "tree", "accuracy": 1e-6}}]
    with Simulation(scene, backend="cpu") as simulation:
        simulation.keep_energy_balance()
        simulation.run(steps=50)
        found = simulation.diagnostics()
    assert abs(found["energy_balance_residual"]) < 1e-3 * found["energy_turnover"]
