"""Adaptive methods on other devices than the CPU: a thread for each copy, in launches of bounded length."""

import numpy as np
import pytest
from test_ias15 import bodies

from mpp_taichi import BackendError, Simulation
from mpp_taichi.errors import CapacityError
from mpp_taichi.integrators._adaptive import Adaptive
from mpp_taichi.step.adaptive_steps import AdaptiveSteps

METHODS = ("adaptive_leapfrog", "adaptive_bogacki_shampine", "adaptive_dop853", "ias15", "taylor")
ECCENTRICITIES = (0.0, 0.5, 0.9)


def scene_of(method):
    """A planet and a light third body about a star; two samples, four orbits of the planet."""
    return {
        "dimensions": 2,
        "particles": bodies((1.0, (0, 0)), (1e-3, (1, 0), (0, 1)), (1e-4, (0, 5), (-0.44, 0))),
        "forces": [{"newtonian_gravity": {}}],
        "integrator": {method: {"dt": 12.0}},
        "run": {"steps": 2},
    }


def copies_of(method, backend):
    """Positions, counts of the step control, and times of the last steps of three copies, whose planets are at apocentre."""
    with Simulation(scene_of("leapfrog"), backend="cpu", precision="f64") as run:
        circle, starts = run.snapshot(), []
    for e in ECCENTRICITIES:
        x, v = circle.position.copy(), circle.velocity.copy()
        x[1, 0], v[1, 1] = 1 + e, np.sqrt((1 - e) / (1 + e))
        starts.append(circle.moved(position=x, velocity=v, time=0.0, step=0))
    with Simulation(scene_of(method), backend=backend, precision="f64", replica_starts=starts) as run:
        run.run()
        counts, times = run.integrator.counts(run.state), run.integrator.times(run.state)
        return np.array([run.snapshot(k).position for k in range(len(starts))]), counts, times


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.sampled(3)
def test_copies_on_vulkan_take_the_steps_that_they_take_on_the_cpu(method, software_vulkan):
    """On Vulkan the factor of a step's length has a relative error of 1e-6: a step of order p has (p + 1) 1e-6 more error.

    The error of an orbit is at most ten tolerances, 1e-6 and smaller, and four orbits make ten of it: together 4e-10. What
    rounding leaves is 4,000 roundings, times 2/(1 − e) at pericentre and 3π · 4 along the orbit: 4e-12.
    """
    here, counts, times = copies_of(method, "cpu")
    there, counts_there, times_there = copies_of(method, "vulkan")
    assert (counts_there[:, Adaptive.STEPS] == counts[:, Adaptive.STEPS]).all()
    assert (times_there >= 24.0).all() and np.abs(times_there / times - 1).max() < 1e-5
    assert np.abs(there - here).max() < 1e-9


@pytest.mark.sampled(3)
def test_many_bodies_on_vulkan_stay_within_the_iterations_of_a_thread(software_vulkan):
    """Software Vulkan stops a thread after 65,535 iterations and says nothing; a step of 16 bodies needs thousands."""
    chaos = np.random.default_rng(3)
    places, speeds = chaos.normal(size=(16, 2)) * 4, chaos.normal(size=(16, 2)) * 0.1
    scene = {
        "dimensions": 2,
        "particles": bodies(*((1 / 16, x, v) for x, v in zip(places.tolist(), speeds.tolist()))),
        "forces": [{"newtonian_gravity": {"softening": 0.5}}],
        "integrator": {"adaptive_dop853": {"dt": 30.0, "tolerance": 1e-9}},
        "run": {"steps": 1},
    }
    found = []
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start = run.snapshot()
    for backend in ("cpu", "vulkan"):
        with Simulation(scene, backend=backend, precision="f64", replica_starts=[start, start]) as run:
            run.run()
            found.append(run.snapshot(1).position)
            evaluations = int(run.integrator.counts(run.state)[1, Adaptive.EVALUATIONS])
    assert evaluations * 16 * 16 > 3 * 65_535  # loops over pairs alone: one launch would not have been enough
    # The tolerance is 1e-9, of which 1e-5 are other errors; each of the few encounters multiplies them by some ten.
    assert np.abs(found[1] - found[0]).max() < 1e-9


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.sampled(3)
def test_the_bits_do_not_depend_on_the_steps_of_a_launch(method, monkeypatch):
    whole, counts, _ = copies_of(method, "cpu")
    monkeypatch.setattr(AdaptiveSteps, "steps_per_launch", property(lambda launcher: 7))
    cut, counts_cut, _ = copies_of(method, "cpu")
    assert np.array_equal(cut, whole) and np.array_equal(counts_cut, counts)


@pytest.mark.parametrize("method", ["adaptive_dop853", "ias15"])
@pytest.mark.sampled(3)
def test_the_bits_do_not_depend_on_the_tries_of_a_call(method, monkeypatch):
    """A light body flies by a star closely, so that steps are refused, with one try each in the second run."""
    scene = scene_of(method) | {"particles": bodies((1.0, (0, 0)), (1e-9, (100, 1e-3), (-50, 0))), "run": {"steps": 1}}

    def flown():
        with Simulation(scene, backend="cpu", precision="f64") as run:
            run.run()
            return run.snapshot().position, run.integrator.counts(run.state)

    whole, counts = flown()
    monkeypatch.setattr(Adaptive, "TRIES", 1)
    cut, counts_cut = flown()
    assert counts[0, Adaptive.REFUSED] > 0 and np.array_equal(cut, whole)
    assert np.array_equal(counts_cut[:, : Adaptive.EVALUATIONS], counts[:, : Adaptive.EVALUATIONS])


def test_a_step_that_needs_too_many_iterations_is_refused(software_vulkan):
    chaos = np.random.default_rng(1)
    scene = {
        "dimensions": 2,
        "particles": bodies(*((1.0, x) for x in chaos.normal(size=(40, 2)).tolist())),
        "forces": [{"newtonian_gravity": {"softening": 0.5}}],
        "integrator": {"ias15": {"dt": 1.0}},
        "run": {"steps": 3},
    }
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start = run.snapshot()
    with pytest.raises(CapacityError, match="stops a kernel thread after 65,535 loop iterations"):
        Simulation(scene, backend="vulkan", precision="f64", replica_starts=[start, start])


def test_one_copy_runs_on_the_cpu_only(software_vulkan):
    with pytest.raises(BackendError, match="one copy with taylor runs on the CPU only, not on vulkan, which runs the copies"):
        Simulation(scene_of("taylor"), backend="vulkan", precision="f64")
