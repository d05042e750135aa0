"""A rocket's thrust: Tsiolkovsky's equation, burn-out, and the journey of scenes/rocket.yaml."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from mpp_taichi import SceneError, Simulation
from mpp_taichi.scene.load import load_scene

SCENE = Path(__file__).parents[2] / "scenes" / "rocket.yaml"
SPEED, FLOW, MASS, IGNITION = 2.5, 0.4, 2.0, 0.3


def flown(*, until, integrator, **parameters):
    """A rocket and a bystander in empty space; ignition by the timeline, with a push along (3, 0, 4)."""
    thrust = {"of": "rocket", "exhaust_speed": SPEED, "flow": 0, "start": IGNITION, "direction": [3, 0, 4]}
    scene = {
        "particles": [
            {"body": {"name": "bystander", "mass": 1.0, "position": [9, 9, 9]}},
            {"body": {"name": "rocket", "mass": MASS, "position": [0, 0, 0], "velocity": [0, 1, 0]}},
        ],
        "forces": [{"thrust": thrust | parameters}],
        "integrator": integrator,
        "run": {"duration": until},
        "timeline": [{"at": IGNITION, "set": {"forces.thrust.flow": FLOW}}],
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        return simulation.run().snapshot()


@pytest.mark.parametrize("integrator", [{"rk4": {"dt": 0.05}}, {"hermite4": {"dt": 0.05}}])
@pytest.mark.sampled(3)
def test_a_burn_gains_what_tsiolkovsky_says(integrator):
    end = flown(until=3.3, integrator=integrator)
    left = MASS - FLOW * 3.0
    gained = SPEED * math.log(MASS / left)
    gone = SPEED / FLOW * (MASS - left - left * math.log(MASS / left))  # the integral of the speed
    # Of the rate r = q/m, at most 0.5, fourth order with dt = 0.05 keeps (r dt)⁴ u r T/100 = 1e-8; hermite4 would be of second
    # order, (r dt)² = 6e-4, if its derivative were wrong.
    unit = np.array([0.6, 0.0, 0.8])
    assert end.velocity[1] - [0, 1, 0] == pytest.approx(gained * unit, abs=3e-8)
    assert end.position[1] - [0, 3.3, 0] == pytest.approx(gone * unit, abs=3e-8)
    assert np.array_equal(end.position[0], [9, 9, 9]), "the bystander is no rocket"


def test_a_rocket_that_is_burnt_out_flies_on():
    # Empty at m = 1.0, 2.5 after ignition; the step during which it happens counts in part: one of 0.01 at 1.0 of acceleration.
    ends = [flown(until=until, integrator={"rk4": {"dt": 0.01}}, empty_mass=1.0) for until in (2.9, 4.9)]
    assert np.linalg.norm(ends[1].velocity[1] - [0, 1, 0]) == pytest.approx(SPEED * math.log(2.0), abs=0.01)
    assert np.array_equal(ends[0].velocity, ends[1].velocity)


def test_a_thrust_with_direction_zero_is_refused():
    forces = [{"thrust": {"exhaust_speed": 1, "flow": 1, "direction": [0, 0, 0]}}]
    scene = {"particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "forces": forces}
    with pytest.raises(SceneError, match=r"forces\[0\].thrust.direction: must not be \[0, 0, 0\]"):
        load_scene(scene | {"integrator": {"leapfrog": {"dt": 0.1}}, "run": {"steps": 1}})


@pytest.mark.sampled(3)
def test_the_rocket_stands_still_above_the_ground_when_its_brakes_go_off():
    scene = yaml.safe_load(SCENE.read_text(encoding="utf-8"))
    del scene["contacts"], scene["expect"]
    scene["integrator"] = {"rk4": {"dt": 5e-4}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        (cutoff, brakes, landing) = (phase.at for phase in simulation.phases[1:])
        assert simulation.snapshot().mass[2] == pytest.approx(1e-6, rel=1e-15)
        masses = [simulation.run(until=time).snapshot().mass[2] for time in (cutoff, brakes, landing)]
        now = simulation.snapshot()
    # Fuel is burnt at 16 and at 4 times the mass at launch in a unit of time.
    lifted = 1.0 - 16 * cutoff
    assert masses == pytest.approx([1e-6 * lifted] * 2 + [1e-6 * (lifted - 4 * (landing - brakes))], rel=1e-14)
    apart, motion = now.position[2] - now.position[1], now.velocity[2] - now.velocity[1]
    up = apart / np.linalg.norm(apart)
    # What the times in the scene are the solution for, found by SciPy's DOP853 and least squares for a rocket without gravity
    # of its own. They are rounded to 5e-9, and 1 of the cutoff's is 270 in place and 1400 in speed; the rocket's 1e-6 moves the
    # planets by 1e-6, and 3 and 26 times as much at the goal.
    assert np.linalg.norm(apart) == pytest.approx(0.154, abs=1e-5)
    assert motion == pytest.approx(-0.05 * up, abs=5e-5)
