"""Bonds that are formulas: springs of Hooke as a formula, orders, energies, groups, limits of the step, and faults."""

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation

MORSE = {"potential": "D*(1 - exp(-a*(l - l0)))^2", "parameters": {"D": 5, "a": 2, "l0": 0.3}, "of": "chain"}


def chain(bond, method="leapfrog", dt=0.005, stiffness=0.0, **more):
    return {
        "particles": [
            {
                "lattice": {
                    "name": "chain",
                    "shape": [5],
                    "lower": [0, 0, 0],
                    "upper": [1.4, 0, 0],
                    "mass": 0.2,
                    "velocity": ["0.2*sin(6*u)", "0.3*u", "0.1*cos(3*u)"],
                }
            },
            {"body": {"name": "free", "position": [0, 2, 0], "mass": 1}},
        ],
        "springs": [
            {"lattice_links": {"of": "chain", "stiffness": stiffness, "prestretch": 1.1}},
            {"link": {"between": ["free", "chain[0]"], "stiffness": 3}},
        ],
        "forces": [{"bond": bond}],
        "integrator": {method: {"dt": dt}},
        "run": {"duration": 1.0},
        **more,
    }


def end_of(scene, **device):
    with Simulation(scene, **{"backend": "cpu", "precision": "f64", **device}) as simulation:
        energy = simulation.mechanics()["total_energy"]
        simulation.run(judge="off")
        return simulation.snapshot().position, simulation.mechanics()["total_energy"] - energy


@pytest.mark.parametrize("method", ["leapfrog", "hermite6", "implicit_midpoint", "energy_momentum"])
@pytest.mark.sampled(2)
def test_hookes_law_as_a_formula_is_a_spring(method):
    formula = {"potential": "D/2*(l - rest)^2", "parameters": {"D": 7}, "of": "chain"}
    found, _ = end_of(chain(formula, method))
    expected, _ = end_of({**chain(formula, method, stiffness=7), "forces": []})
    # The methods that solve equations stop at a tolerance of 1e-12 or so of the places; the others only round.
    assert np.abs(found - expected).max() < 1e-9


@pytest.mark.parametrize(
    ("method", "order"),
    [
        *[("leapfrog", 2), ("yoshida4", 4), ("hermite4", 4), ("hermite6", 6), ("rk4", 4), ("implicit_midpoint", 2)],
        *[("energy_momentum", 2), ("newmark", 2), ("imex_midpoint", 2)],
    ],
)
@pytest.mark.sampled(3)
def test_methods_keep_their_order(method, order):
    exact, _ = end_of(chain(MORSE, "ias15", 0.05))
    errors = [np.abs(end_of(chain(MORSE, method, dt))[0] - exact).max() for dt in (0.01, 0.005)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.4)


def test_energy_momentum_keeps_the_energy():
    """To the tolerance of its equations, though the potential is no square."""
    _, change = end_of(chain(MORSE, "energy_momentum", 0.02))
    _, of_midpoint = end_of(chain(MORSE, "implicit_midpoint", 0.02))
    assert abs(change) < 1e-11 and abs(of_midpoint) > 1e-6


@pytest.mark.parametrize(
    "device",
    [{"precision": "f32"}, {"plan": "parallel"}, {"backend": "vulkan", "precision": "f32"}],
    ids=str,
)
@pytest.mark.sampled(2)
def test_devices_and_plans_agree(device, request):
    if "backend" in device:
        request.getfixturevalue("software_vulkan")
    expected, _ = end_of(chain(MORSE))
    found, _ = end_of(chain(MORSE), **device)
    # 200 steps of some ten roundings each, of 2⁻²⁴ in f32; the plans round in the same order or nearly so.
    assert np.abs(found - expected).max() < (1e-12 if "plan" in device else 2e-5)


def test_arithmetic_alone_runs_in_double_single_numbers():
    law = {"potential": "D*(l - rest)^2*(1 + l^2)", "parameters": {"D": 5}}
    expected, _ = end_of(chain(law))
    found, _ = end_of(chain(law), precision="df64")
    assert np.abs(found - expected).max() < 1e-12


def test_only_springs_of_the_group_have_the_force():
    scene = chain({"potential": "5*l", "of": "chain[0:2]"})
    scene["springs"] = scene["springs"][:1]
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        found = simulation.accelerations()
    expected = np.zeros((6, 3))
    expected[:2, 0] = [5 / 0.2, -5 / 0.2]  # a constant tension
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_the_limit_of_the_step_knows_bonds():
    """The same network of springs by Hooke's law and by the formula has the same limit; it is 2/ω of the fastest mode."""
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.stability.network import SpringNetwork
    from mpp_taichi.start.assemble import assemble

    formula = {"potential": "D/2*(l - rest)^2", "parameters": {"D": 7}, "of": "chain"}
    scenes = (chain(formula), {**chain(formula, stiffness=7), "forces": []})
    rates = [SpringNetwork(spec, assemble(spec)).stiffness.upper for spec in map(load_scene, scenes)]
    assert rates[0] == pytest.approx(rates[1], rel=1e-12) and rates[0] > 0.0


@pytest.mark.parametrize(
    ("bond", "told"),
    [
        ({"potential": "log(l - 1)"}, "bond: the formula gives no number at the length 0.35 of the spring between"),
        ({"potential": "r^2"}, "bond.potential: unknown name 'r'"),
        ({"potential": "l^2", "of": "nowhere"}, "bond.of: .*nowhere"),
    ],
)
def test_faults_are_told(bond, told):
    with pytest.raises(SceneError, match=told), Simulation(chain(bond), backend="cpu"):
        pass


def test_a_group_without_springs_is_refused():
    scene = chain({"potential": "l^2", "of": "alone"})
    scene["particles"] = [*scene["particles"], {"body": {"name": "alone", "mass": 1, "position": [9, 9, 9]}}]
    with pytest.raises(SceneError, match="bond: no spring is between two particles of its group"):
        Simulation(scene, backend="cpu")


def test_without_springs_there_is_nothing_to_act_on():
    with pytest.raises(SceneError, match="bond: acts along springs, and this scene has none"):
        Simulation({**chain({"potential": "l^2"}), "springs": []}, backend="cpu")
