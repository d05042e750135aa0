"""Walls with a temperature: the gas that they heat, their flux, their bits and what they refuse."""

import math

import numpy as np
import pytest
from repeated_runs import run_with_a_way_back
from scipy import stats

from mpp_taichi import SceneError, Simulation
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.errors import UnsupportedError
from mpp_taichi.scene.load import load_scene

KT, MASS, COUNT = 1.5, 2.0, 1500
FALSE_ALARM = 1e-6
SIGMAS = stats.norm.isf(FALSE_ALARM / 2)


def gas(solver="event_driven", *, dimensions=3, radius=0.0, temperature=KT, walls=None, count=COUNT, **more):
    """A cold gas in a box whose walls have a temperature."""
    lower, upper = [-1] * dimensions, [1] * dimensions
    scene = {
        "dimensions": dimensions,
        "seed": 5,
        "particles": [
            {"gas": {"count": count, "lower": lower, "upper": upper, "radius": radius, "mass": MASS, "temperature": 0.25}}
        ],
        "walls": walls or [{"box": {"lower": lower, "upper": upper, "temperature": temperature}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "integrator": {"event_driven" if solver == "event_driven" else "leapfrog": {"dt": 0.05}},
    }
    return scene | more


def run(scene, steps, **more):
    with Simulation(scene, **({"backend": "cpu", "precision": "f64"} | more)) as simulation:
        simulation.run(steps=steps)
        return simulation.snapshot(), simulation.contact_report


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("solver", ["event_driven", "swept"])
def test_a_gas_comes_to_the_temperature_and_the_distribution_of_its_walls(solver, dimensions):
    found, report = run(gas(solver, dimensions=dimensions), 1200)
    assert report.wall_count > 30 * COUNT  # slow points have met a wall as well
    velocity = found.velocity[:, :dimensions]
    share = (velocity**2).mean() * MASS / KT
    assert abs(share - 1.0) < SIGMAS * math.sqrt(2.0 / velocity.size)
    assert stats.kstest(velocity.ravel() / math.sqrt(KT / MASS), "norm").pvalue > FALSE_ALARM
    assert np.abs(found.position).max() <= 1.0 + 1e-12
    # The density is even, and does not depend on the velocity.
    assert stats.kstest(found.position[:, :dimensions].ravel(), stats.uniform(-1, 2).cdf).pvalue > FALSE_ALARM
    assert abs(np.corrcoef(found.position[:, 0] ** 2, found.velocity[:, 0] ** 2)[0, 1]) < SIGMAS / math.sqrt(COUNT)


def test_the_energy_that_walls_give_is_booked():
    scene = gas("swept", count=400)
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.keep_energy_balance()
        found = simulation.run(steps=100).diagnostics()
        assert not simulation.phase.conserves_energy and not simulation.phase.gains_no_energy
    assert found["dissipated_energy"] < 0.0
    assert abs(found["energy_balance_residual"]) < 1e-12 * found["energy_turnover"]


def test_heat_flows_from_the_hot_wall_to_the_cold_wall_as_in_a_gas_without_collisions():
    """Points between two walls: the fluxes of both kinds of points are equal, n₁ √T₁ = n₂ √T₂ (Knudsen)."""
    hot, cold = 4.0, 1.0
    walls = [
        {"plane": {"point": [-1, 0, 0], "normal": [1, 0, 0], "temperature": hot}},
        {"plane": {"point": [1, 0, 0], "normal": [-1, 0, 0], "temperature": cold, "seed": 2}},
    ]
    found, _ = run(gas(walls=walls, count=4000), 2000)
    right = found.velocity[:, 0] > 0.0  # these come from the hot wall
    share = math.sqrt(cold) / (math.sqrt(hot) + math.sqrt(cold))
    assert abs(right.mean() - share) < SIGMAS * math.sqrt(share * (1.0 - share) / 4000)
    for kind, temperature in ((right, hot), (~right, cold)):
        along = found.velocity[kind, 1]
        assert abs((along**2).mean() * MASS / temperature - 1.0) < SIGMAS * math.sqrt(2.0 / kind.sum())


@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_round_walls_heat_as_well(kind):
    place = {"point": [0, 0, 0]} if kind == "cylinder" else {"center": [0, 0, 0]}
    walls = [{kind: place | {"radius": 1.8, "inside": True, "temperature": KT}}]
    found, _ = run(gas(walls=walls), 1200)
    velocity = found.velocity[:, :2]
    assert abs((velocity**2).mean() * MASS / KT - 1.0) < SIGMAS * math.sqrt(2.0 / velocity.size)


@pytest.mark.parametrize("solver", ["event_driven", "swept"])
def test_the_bits_depend_neither_on_threads_nor_on_cuts(solver):
    scene = gas(solver, radius=0.02, count=500)
    whole = run(scene, 60)[0]
    with Simulation(scene, backend="cpu", precision="f64", threads=1) as simulation:
        assert np.array_equal(run_with_a_way_back(simulation, 17, 9, 43).velocity, whole.velocity)
    other = run(gas(solver, radius=0.02, count=500, walls=[{"box": scene["walls"][0]["box"] | {"seed": 9}}]), 60)[0]
    assert not np.array_equal(other.velocity, whole.velocity)


def test_vulkan_heats_too():
    found, _ = run(gas("swept", count=600), 400, backend="vulkan", precision="f32")
    assert abs((found.velocity**2).mean() * MASS / KT - 1.0) < SIGMAS * math.sqrt(2.0 / found.velocity.size)


def test_a_wall_of_no_temperature_stops_all_that_meet_it():
    body = {"body": {"name": "ball", "mass": 1, "radius": 0.1, "position": [0, 0, 0], "velocity": [1, 0.5, 0]}}
    walls = [{"plane": {"point": [1, 0, 0], "normal": [-1, 0, 0], "temperature": 0}}]
    scene = gas("swept", walls=walls) | {"particles": [body]}
    found, _ = run(scene, 40)
    assert found.velocity[0] == pytest.approx([0, 0, 0], abs=1e-15)
    assert found.position[0] == pytest.approx([0.9, 0.45, 0])


@pytest.mark.parametrize("solver", ["pairwise", "simultaneous", "resting"])
def test_other_solvers_refuse_them_at_the_wall(solver):
    scene = gas("swept") | {"contacts": {"hard_spheres": {"solver": solver}}}
    with pytest.raises(SceneError, match=r"walls\[0\].box.temperature: a wall with a temperature goes with the solvers event"):
        load_scene(scene)


def test_what_needs_a_motion_without_chance_is_refused():
    scene = gas("swept", count=5) | {"run": {"steps": 10}}
    with pytest.raises(SceneError, match="accuracy compares motions, and box draws them at random"):
        pose(load_scene(scene))
    tangent = gas("event_driven", count=5, radius=0.05) | {"inspect": [{"y": "lyapunov"}]}
    with pytest.raises(UnsupportedError, match="walls with a temperature"):
        Simulation(tangent, backend="cpu")
