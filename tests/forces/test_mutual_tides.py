"""Tides between bodies that both move: action and reaction, the rates of Hut's closed forms, and the account of the energy."""

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.errors import MppError

TAU = 2.0 * np.pi
TIDE = {"radius": 0.4, "love_number": 0.3, "lag": 0.2, "spin": [0.3, -0.5, 0.9]}


def body(name, mass, position, velocity, **more):
    return {"body": {"name": name, "mass": mass, "position": position, "velocity": velocity, **more}}


def scene_of(bodies, forces, method="dop853", **step):
    return {"particles": bodies, "forces": forces, "integrator": {method: step or {"dt": 0.05}}}


def felt(bodies, forces, dimensions=3):
    scene = scene_of(bodies, forces) | {"dimensions": dimensions}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        return simulation.accelerations()


def test_a_body_beside_a_planet_at_rest_feels_what_it_feels_about_the_origin():
    """In space and in the plane the force is that of `tides`, whose planet stands at the origin."""
    for dimensions in (3, 2):
        place, speed = [0.8, -0.3, 0.5][:dimensions], [0.2, 0.9, -0.4][:dimensions]
        spin = TIDE["spin"] if dimensions == 3 else [0, 0, 0.9]
        planet, moon = body("planet", 5.0, [0.0] * dimensions, [0.0] * dimensions), body("moon", 0.6, place, speed)
        tide = TIDE | {"spin": spin}
        found = felt([planet, moon], [{"mutual_tides": tide | {"of": "planet"}}], dimensions)
        wanted = felt([planet, moon], [{"tides": tide | {"on": "moon"}}], dimensions)
        np.testing.assert_allclose(found[1], wanted[1], rtol=1e-13)
        np.testing.assert_allclose(5.0 * found[0], -0.6 * found[1], rtol=1e-13)


THREE = [
    body("a", 0.7, [0.0, 0.1, 0], [0.2, 0, 0.1]),
    body("b", 0.4, [1.0, 0, 0.2], [0, 0.6, 0]),
    body("c", 0.3, [-0.5, 0.9, 0], [0.4, 0, 0.5]),
]


def test_tides_of_several_bodies_are_the_sum_of_those_of_pairs_and_move_no_centre():
    on_all = {"mutual_tides": TIDE | {"of": "a"}}
    alone = [{"mutual_tides": TIDE | {"name": by, "of": "a", "by": by}} for by in ("b", "c")]
    both = felt(THREE, [on_all])
    np.testing.assert_allclose(both, felt(THREE, alone), rtol=1e-13)
    forces = np.array([[0.7], [0.4], [0.3]]) * both
    assert np.abs(forces.sum(axis=0)).max() < 1e-14 * np.abs(forces).max()
    faster = [[v + w for v, w in zip(each["body"]["velocity"], (3, -2, 1))] for each in THREE]
    moved = [{"body": each["body"] | {"velocity": velocity}} for each, velocity in zip(THREE, faster)]
    np.testing.assert_allclose(felt(moved, [on_all]), both, rtol=0, atol=1e-13 * np.abs(both).max())
    assert np.abs(felt(THREE, [{"mutual_tides": TIDE | {"of": "b", "by": "c"}}])[0]).max() == 0.0


def binary(e, *, ratio=1 / 3, spin=1.0, love=1e-4, lag=0.05, radius=0.4):
    """Two bodies of the mass 1 together at the pericentre of an orbit with a = 1; the heavy body yields."""
    light = ratio / (1.0 + ratio)
    near, fast = 1.0 - e, np.sqrt((1.0 + e) / (1.0 - e))
    bodies = [
        body("heavy", 1.0 - light, [-light * near, 0, 0], [0, -light * fast, 0]),
        body("light", light, [(1.0 - light) * near, 0, 0], [0, (1.0 - light) * fast, 0]),
    ]
    tide = {"of": "heavy", "radius": radius, "love_number": love, "lag": lag, "spin": [0, 0, spin]}
    return bodies, [{"newtonian_gravity": {}}, {"mutual_tides": tide}]


def mean_elements(e, turns, **more):
    """Semi-major axis and eccentricity vector, each the mean over the first turn and over the last turn."""
    bodies, forces = binary(e, **more)
    found = []
    with Simulation(scene_of(bodies, forces, dt=TAU / 100), backend="cpu", precision="f64") as simulation:
        for turn in range(turns):
            rows = []
            if turn in (0, turns - 1):
                for _ in range(100):
                    simulation.run(steps=1)
                    now = simulation.snapshot()
                    d, w = now.position[1] - now.position[0], now.velocity[1] - now.velocity[0]
                    r = np.linalg.norm(d)
                    rows.append([1.0 / (2.0 / r - w @ w), *(np.cross(w, np.cross(d, w)) - d / r)])
                found.append(np.mean(rows, axis=0))
            else:
                simulation.run(steps=100)
    return [(row[0], np.linalg.norm(row[1:])) for row in found]


@pytest.mark.parametrize("spin", [0.0, 1.0, 2.5])
def test_axes_and_eccentricities_change_at_the_rates_of_hut(spin):
    """Masses 3:1, so that 1 + m/M, which a planet that does not recoil lacks, is 4/3 and would be seen."""
    e, turns, love, lag, radius = 0.02, 100, 0.02, 0.05, 0.4
    first, last = mean_elements(e, turns, spin=spin, love=love, lag=lag, radius=radius)
    axis = 0.5 * (first[0] + last[0])  # in the middle of the time; the next term of the change, of 1 %, is the square of it
    n, size = axis**-1.5, love * lag * 0.25 * (4 / 3) * radius**5 / axis**8
    time = TAU * (turns - 1)
    # Hut's functions of e are 1 + 23 e², 1 + 13.5 e², 1 + 10.3 e² and 1 + 6.5 e² here: below 1 % and 0.5 % of each term.
    rate = np.log(last[0] / first[0]) / time
    assert rate == pytest.approx(6 * size * (spin / n - 1.0), abs=6 * size * 0.01 * max(1.0, spin))
    damping = np.log(last[1] / first[1]) / time
    assert damping == pytest.approx(-27 * size * (1 - 11 / 18 * spin / n), abs=27 * size * 0.005 * max(1.0, spin))


@pytest.mark.parametrize(("method", "order"), [("leapfrog", 2), ("pefrl", 4), ("kahan_li6", 6), ("rk4", 4), ("newmark", 2)])
def test_methods_keep_their_order_and_the_balance_closes(method, order):
    bodies, forces = binary(0.2, love=0.3, lag=0.3, radius=0.45, spin=2.0)
    ends, residuals = [], []
    for name, steps in (("dop853", 1600), (method, 40 if order > 2 else 160), (method, 80 if order > 2 else 320)):
        with Simulation(scene_of(bodies, forces, name, dt=3.0 / steps), backend="cpu", precision="f64") as simulation:
            balance = simulation.keep_energy_balance()
            simulation.run(steps=steps)
            ends.append(simulation.snapshot().position)
            account = balance.account(simulation, simulation.mechanics()["total_energy"])
            residuals.append(abs(account["energy_balance_residual"]) / abs(account["dissipated_energy"]))
    errors = [np.abs(end - ends[0]).max() for end in ends[1:]]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)
    # The exact motion loses what the powers say; powers of a step of 1/530 revolution are integrated to fourth order.
    assert residuals[0] < 1e-7


@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_single_precision_on_the_cpu_and_on_vulkan_moves_the_bodies_alike(software_vulkan, plan):
    bodies, forces = binary(0.2, love=0.3, lag=0.3, radius=0.45, spin=2.0)
    ends = []
    for backend, precision in (("cpu", "f64"), ("cpu", "f32"), ("vulkan", "f32")):
        scene = scene_of(bodies, forces, "leapfrog", dt=0.05)
        with Simulation(scene, backend=backend, precision=precision, plan=plan) as simulation:
            simulation.run(steps=50)
            ends.append(simulation.snapshot().position)
    # 50 steps of a kick and two drifts of places below 1.
    assert max(np.abs(end - ends[0]).max() for end in ends[1:]) <= 50 * 3 * 2.0**-24
    assert np.abs(ends[1] - ends[0]).max() > 0.0


@pytest.mark.parametrize("method", ["hermite4", "wisdom_holman", "rkn8"])
def test_methods_that_take_no_velocities_refuse_tides_by_name(method):
    with pytest.raises(MppError, match="mutual_tides"):
        Simulation(scene_of(*binary(0.1), method, dt=0.01), backend="cpu", precision="f64")
