"""Copies of a system in the lanes of vector registers: each has the bits that it has without lanes."""

from dataclasses import replace

import numpy as np
import pytest

from mpp_taichi import Simulation, component, load_scene
from mpp_taichi.start.assemble import assemble
from mpp_taichi.step import replicas, tangent_steps
from scenes import INTEGRATORS, everything, kepler

METHODS = [name for name in INTEGRATORS if component.flag("integrators", name, "takes_any_numbers") and name != "dop853"]
KINDS = ["leapfrog", "velocity_verlet", "rk4", "pefrl", "chin4a"]  # one of each kind of step
STEPS = 20
pytestmark = pytest.mark.fast_taichi("explicit_vectors")


def starts(scene, count):
    """Starts that differ in places, velocities, masses and charges."""
    start, draw = assemble(load_scene(scene)), np.random.default_rng(3)

    def shifted(values, free=1.0):
        return values * (1 + 0.1 * draw.uniform(-1, 1, values.shape) * free)

    return [
        replace(
            start,
            position=shifted(start.position, start.free),
            velocity=shifted(start.velocity, start.free),
            mass=shifted(start.mass),
            charge=shifted(start.charge),
        )
        for _ in range(count)
    ]


def ends(scene, found, *, precision="f64", launches=(STEPS,), threads=1):
    options = {"backend": "cpu", "precision": precision, "plan": "replicas", "threads": threads}
    with Simulation(scene, **options, replica_starts=tuple(found)) as simulation:
        simulation.phase.place(simulation.start, simulation.dt)
        for steps in launches:
            simulation.try_steps(steps, judged=False)
        return np.concatenate(simulation.state.read_replicas()), simulation.phase.launcher.lanes is not None


def without_lanes(monkeypatch):
    monkeypatch.setattr(replicas, "may_have_lanes", lambda launcher: False)


@pytest.mark.parametrize(
    ("name", "precision"), [*((name, "f64") for name in METHODS), *((name, "f32") for name in KINDS)]
)  # registers of f32 have more lanes, which no stage of a method knows
@pytest.mark.sampled(6)
def test_lanes_change_no_bit(name, precision, monkeypatch):
    scene = everything(integrator=name)
    found = starts(scene, 19)
    in_lanes, has_lanes = ends(scene, found, precision=precision)
    without_lanes(monkeypatch)
    plain, has_none = ends(scene, found, precision=precision)
    assert has_lanes and not has_none
    np.testing.assert_array_equal(in_lanes, plain)
    assert np.isfinite(plain).all() and (np.abs(np.diff(plain, axis=0)) > 0).any()


def without_pairs(**changes):
    """Springs, a field and an axis that is held; vectors of such a scene are stored as a whole, not by components."""
    scene = everything(**changes)
    return {**scene, "forces": [force for force in scene["forces"] if not {"newtonian_gravity", "coulomb"} & force.keys()]}


@pytest.mark.parametrize("measured", [{}, {"expect": {"fli": {"below": 1e9}}}], ids=["plain", "tangent"])
@pytest.mark.parametrize("name", ["leapfrog", "rk4"])
@pytest.mark.sampled(4)
def test_lanes_change_no_bit_of_a_scene_without_pairs(name, measured, monkeypatch):
    scene = {**without_pairs(integrator=name), **measured}
    found = starts(scene, 9)
    in_lanes, has_lanes = ends(scene, found)
    for module in (replicas, tangent_steps):
        monkeypatch.setattr(module, "may_have_lanes", lambda launcher: False)
    plain, _ = ends(scene, found)
    assert has_lanes
    np.testing.assert_array_equal(in_lanes, plain)
    assert (plain[:9] != np.stack([each.position for each in found])).any()  # they have moved


@pytest.mark.parametrize(("name", "precision"), [*((name, "f64") for name in KINDS), ("leapfrog", "f32")])
@pytest.mark.sampled(6)
def test_lanes_change_no_bit_of_a_tangent(name, precision, monkeypatch):
    scene = {**everything(integrator=name), "expect": {"megno": {"above": -1e9}}}
    found, growths = starts(scene, 11), []
    for has_lanes in (True, False):
        if not has_lanes:
            monkeypatch.setattr(tangent_steps, "may_have_lanes", lambda launcher: False)
        options = {"backend": "cpu", "precision": precision, "plan": "replicas", "replica_starts": tuple(found)}
        with Simulation(scene, **options) as simulation:
            assert (simulation.phase.launcher.lanes is not None) == has_lanes
            simulation.try_steps(STEPS, judged=False)
            growth = simulation.phase.read_tangent()
            growths.append((growth.growth, growth.megno, *simulation.phase.tangent.read_deviation()))
    for in_lanes, plain in zip(*growths):
        np.testing.assert_array_equal(in_lanes, plain)
        assert len(np.unique(plain)) > 10


@pytest.mark.parametrize("count", [2, 8, 17])
@pytest.mark.sampled(3)
def test_bits_do_not_depend_on_the_other_lanes_on_launches_or_on_threads(count):
    scene = kepler()
    found = starts(scene, 17)
    whole, _ = ends(scene, found)
    some, has_lanes = ends(scene, found[17 - count :], launches=(3, 1, STEPS - 4), threads=2)
    assert has_lanes
    np.testing.assert_array_equal(some, whole.reshape(2, 17, *whole.shape[1:])[:, 17 - count :].reshape(some.shape))


def test_a_copy_that_is_no_number_leaves_the_others_alone():
    scene = kepler()
    found = starts(scene, 9)
    whole, _ = ends(scene, found)
    found[4] = replace(found[4], velocity=np.full_like(found[4].velocity, np.inf))
    with np.errstate(invalid="ignore"):
        broken, _ = ends(scene, found)
    whole, broken = (each.reshape(2, 9, *each.shape[1:]) for each in (whole, broken))
    others = np.arange(9) != 4
    np.testing.assert_array_equal(broken[:, others], whole[:, others])
    assert not np.isfinite(broken[:, 4]).all()


@pytest.mark.parametrize("scene", [kepler(integrator=name) for name in ("implicit_midpoint", "ias15", "dop853")])
def test_implicit_and_adaptive_methods_and_methods_of_many_stages_have_no_lanes(scene):
    with Simulation(scene, backend="cpu", plan="replicas", replica_starts=tuple(starts(scene, 9))) as simulation:
        assert getattr(simulation.phase.launcher, "lanes", None) is None
