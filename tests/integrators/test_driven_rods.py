"""Rods with an end on a given path: Lagrange's equations of a pendulum whose pivot is shaken, its energy and its rod force."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_integrators import declared

from mpp_taichi import Simulation, component
from mpp_taichi.quantities._base import Setting
from mpp_taichi.recorders._simulation_sample import SimulationSample

GRAVITY, LENGTH, SWING, RATE, ANGLE, PIVOT, BOB = 9.81, 1.0, 0.1, 6.0, 0.5, 1.0, 2.0
TAKES_BOTH = [n for n in component.marked("integrators", "takes_paths") if component.flag("integrators", n, "takes_rods")]


def shaken_pendulum(name, dt, drag=0.0):
    place = [LENGTH * np.sin(ANGLE), 0.0, SWING - LENGTH * np.cos(ANGLE)]
    return {
        "constants": {"a": SWING, "w": RATE},
        "particles": [
            {"body": {"name": "pivot", "mass": PIVOT, "path": ["0.05*sin(2*t)^2", "0", "a*cos(w*t)"]}},
            {"body": {"name": "bob", "mass": BOB, "position": list(map(float, place))}},
        ],
        "springs": [{"rod": {"between": ["pivot", "bob"]}}],
        "forces": [
            {"uniform_gravity": {"acceleration": [0, 0, -GRAVITY]}},
            *([{"linear_drag": {"coefficient": drag}}] if drag else []),
        ],
        "integrator": {name: {"dt": dt}},
    }


def pivot(t):
    """Place, velocity and acceleration of the pivot in the plane x–z."""
    return (
        np.array([0.05 * np.sin(2 * t) ** 2, SWING * np.cos(RATE * t)]),
        np.array([0.1 * np.sin(4 * t), -SWING * RATE * np.sin(RATE * t)]),
        np.array([0.4 * np.cos(4 * t), -SWING * RATE**2 * np.cos(RATE * t)]),
    )


def lagrange(time, drag):
    """Place of the bob, work of the agent, dissipated energy and force of the rod, by the equation of motion in the angle."""

    def forces(t, y):
        angle, turn = y[:2]
        _, v, a = pivot(t)
        across, along = np.array([np.cos(angle), np.sin(angle)]), np.array([np.sin(angle), -np.cos(angle)])
        bob = v + LENGTH * turn * across
        field = np.array([0.0, -GRAVITY]) - drag / BOB * bob
        push = (field - a) @ across / LENGTH
        pull = (field - a - LENGTH * push * across + LENGTH * turn**2 * along) @ along * BOB  # of the bob on the rod
        on_pivot = pull * along + PIVOT * np.array([0.0, -GRAVITY]) - drag * v
        return turn, push, (PIVOT * a - on_pivot) @ v, drag * (bob @ bob + v @ v), pull

    y = solve_ivp(lambda t, y: forces(t, y)[:4], (0, time), [ANGLE, 0, 0, 0], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    x = pivot(time)[0]
    place = np.array([x[0] + LENGTH * np.sin(y[0]), 0.0, x[1] - LENGTH * np.cos(y[0])])
    return place, y[2], y[3], forces(time, y)[4]


@pytest.mark.parametrize("drag", [0.0, 0.4])
@pytest.mark.parametrize("name", TAKES_BOTH)
@pytest.mark.sampled(6)
def test_each_method_keeps_its_order_along_rods(name, drag):
    order = declared(name, "order")
    if drag and not declared(name, "takes_velocity"):
        pytest.skip("takes no friction")
    dt = {1: 0.005, 2: 0.01, 3: 0.01, 4: 0.02, 6: 0.04, 8: 0.1}[order]
    exact, errors, balances = lagrange(2.0, drag), [], []
    for steps in (round(2.0 / dt), 2 * round(2.0 / dt)):
        with Simulation(shaken_pendulum(name, 2.0 / steps, drag), backend="cpu") as simulation:
            simulation.keep_energy_balance()
            simulation.run(steps=steps)
            found = simulation.diagnostics()
            errors.append(np.abs(simulation.snapshot().position[1] - exact[0]).max())
            balances.append(abs(found["energy_balance_residual"]))
    assert errors[1] < (1e-2 if order == 1 else 1e-4), errors
    assert np.log2(errors[0] / errors[1]) > order - 0.5, errors
    assert np.log2(balances[0] / balances[1]) > min(order, 4) - 0.5, balances  # the powers are integrated to fourth order
    if order > 1:
        assert abs(found["work"] - exact[1]) < 2e-3
        assert abs(found["dissipated_energy"] - exact[2]) < 2e-3


@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_the_rod_keeps_its_length_and_its_force_is_that_of_the_pendulum(plan):
    with Simulation(shaken_pendulum("yoshida4", 0.005), backend="cpu", plan=plan) as simulation:
        simulation.run(steps=200)
        now = simulation.snapshot()
        assert abs(np.linalg.norm(now.position[1] - now.position[0]) - LENGTH) < 1e-14
        place, _, _, pull = lagrange(1.0, 0.0)
        assert np.abs(now.position[1] - place).max() < 1e-8
        force = component.build("quantities", "rod_force", {"between": (0, 1)})
        force.begin(Setting(simulation.spec, simulation.start))
        assert force.measure(SimulationSample(simulation)) == pytest.approx(pull, rel=1e-6)


def test_the_work_on_rods_goes_back_with_the_run():
    with Simulation(shaken_pendulum("leapfrog", 0.01), backend="cpu") as simulation:
        simulation.keep_energy_balance()
        simulation.run(steps=50)
        bookmark = simulation.bookmark()
        first = simulation.run(steps=50).diagnostics()
        simulation.go_back(bookmark)
        assert simulation.run(steps=50).diagnostics()["work"] == first["work"]


def test_steps_backwards_undo_the_steps_along_rods():
    with Simulation(shaken_pendulum("yoshida4", 0.01), backend="cpu") as simulation:
        start = simulation.snapshot()
        simulation.run(steps=100)
        assert simulation.try_steps(100, -0.01)
        assert np.allclose(simulation.snapshot().position, start.position, rtol=0.0, atol=1e-12)
        assert np.allclose(simulation.snapshot().velocity, start.velocity, rtol=0.0, atol=1e-11)
