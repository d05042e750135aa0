"""The tangent of a step: its deviations are the derivative of the run, and the run itself keeps its bits."""

import numpy as np
import pytest
from shifted_starts import ends_from

from mpp_taichi import Simulation, component
from mpp_taichi.errors import BackendError, UnsupportedError
from scenes import INTEGRATORS, everything, kepler

TAKES_TANGENT = [
    name
    for name in INTEGRATORS
    if any(component.flag("integrators", name, f"takes_{way}") for way in ("any_numbers", "tangent"))
]
STEPS = 40
SHIFT = 2.0**-20  # of the start, along the deviation
ROUND_OFF = 2.0**-53
MEASURED = {"megno": {"above": -1e9}}


def with_tangent(scene):
    return {**scene, "expect": MEASURED}


@pytest.mark.parametrize("name", TAKES_TANGENT)
@pytest.mark.sampled(6)
def test_deviations_are_the_derivative_of_the_run(name):
    scene = everything(integrator=name)
    with Simulation(with_tangent(scene), backend="cpu", precision="f64") as simulation:
        start = np.concatenate(simulation.state.read())
        deviation = np.concatenate(simulation.phase.tangent.read_deviation())
        simulation.run(steps=STEPS, judge="off")
        found = np.concatenate(simulation.phase.tangent.read_deviation())
    # Differences over h and 2 h, extrapolated: the error is of fourth order in h, beside rounding over h.
    sides = ends_from(scene, [start + k * SHIFT * deviation for k in (-2, -1, 1, 2)], STEPS)
    near, far = (sides[2] - sides[1]) / (2 * SHIFT), (sides[3] - sides[0]) / (4 * SHIFT)
    by_difference = (4 * near - far) / 3
    size = np.abs(np.concatenate(sides)).max()
    # Each step rounds positions and velocities some ten times; rounding errors grow as deviations do.
    rounding = 10 * STEPS * ROUND_OFF * size * np.abs(found).max() / SHIFT
    assert rounding < 1e-6
    assert np.abs(found - by_difference).max() < rounding + np.abs(near - far).max() ** 2
    assert np.abs(near - far).max() < 1e-8  # of second order in h: the differences are derivatives


@pytest.mark.parametrize("name", TAKES_TANGENT)
@pytest.mark.parametrize("scene", [everything, lambda integrator: kepler(integrator=integrator)], ids=["everything", "kepler"])
@pytest.mark.sampled(6)
def test_a_tangent_changes_no_bit_of_the_run(name, scene):
    ends = []
    for written in (scene(integrator=name), with_tangent(scene(integrator=name))):
        with Simulation(written, backend="cpu", precision="f64", plan="serial") as simulation:
            simulation.run(steps=STEPS, judge="off")
            ends.append(np.concatenate(simulation.state.read()))
    np.testing.assert_array_equal(*ends)


def test_only_scenes_that_ask_for_it_have_a_tangent():
    with Simulation(everything(), backend="cpu") as simulation:
        assert not any(name.startswith("tangent_") for name in simulation.state.quantities)
        with pytest.raises(TypeError, match="no quantity of this scene needs the tangent"):
            simulation.phase.read_tangent()


@pytest.mark.parametrize("name", ["leapfrog", "ias15"])
@pytest.mark.sampled(3)
def test_deviations_are_rescaled_without_a_change_of_digits(name):
    ends = []
    for scale in (1.0, 2.0**60, 2.0**-60):  # far outside of the range in which deviations are kept
        with Simulation(with_tangent(kepler(integrator=name)), backend="cpu", precision="f64") as simulation:
            meter = simulation.phase.tangent
            meter.write(*(scale * each for each in meter.read_deviation()))
            simulation.run(steps=200, judge="off")
            ends.append((np.concatenate(meter.read_deviation()), meter.read().growth[0]))
    for deviation, growth in ends[1:]:
        np.testing.assert_allclose(deviation, ends[0][0], rtol=1e-13)  # by exp and logarithm of the scale
        assert growth == pytest.approx(ends[0][1], abs=1e-13)


@pytest.mark.parametrize(
    "change, part",
    [
        ({"integrator": {"taylor": {"dt": 0.1}}}, "the method taylor does not have"),
        ({"integrator": {"implicit_midpoint": {"dt": 0.1}}}, "the method implicit_midpoint does not have"),
        (
            {"forces": [{"harmonic_drive": {"force": [1, 0, 0], "angular_frequency": 1}}]},
            "the force harmonic_drive does not have",
        ),
        ({"contacts": {"hard_spheres": {"solver": "pairwise"}}}, "collisions of pairwise do not have"),
        ({"timeline": [{"at": 0.5, "set": {"forces.newtonian_gravity.strength": 0}}]}, "a timeline does not have"),
        ({"forces": [{"newtonian_gravity": {"solver": "tree"}}]}, "a tree does not have"),
    ],
)
def test_what_has_no_tangent_is_refused_by_name(change, part):
    with pytest.raises(UnsupportedError, match=f"megno needs the derivative of every step, which {part}"):
        Simulation({**with_tangent(kepler()), **change}, backend="cpu")


@pytest.mark.parametrize("precision", ["f32c", "ds"])
def test_low_parts_have_no_tangent(precision):
    with pytest.raises(UnsupportedError, match=f"steps in {precision} do not have"):
        Simulation(with_tangent(kepler()), backend="cpu", precision=precision)


def test_the_parallel_plan_has_no_tangent():
    with pytest.raises(BackendError, match="megno has no parallel plan; there are serial and replicas"):
        Simulation(with_tangent(kepler()), backend="cpu", plan="parallel")
