"""Numbers that are not finite are found at the step where they arise, on every backend."""

import numpy as np
import pytest

from mpp_taichi import BackendError, CapacityError, MppError, Simulation, StabilityError
from mpp_taichi.device import backends
from mpp_taichi.simulation import first_bad_step
from scenes import cluster, kepler

BACKENDS = [("cpu", "serial"), ("cpu", "parallel"), ("vulkan", "parallel")]


def head_on(dt=0.25, distance=1.0):
    """Two bodies at rest that meet exactly at the origin: by symmetry leapfrog puts both there after some step."""
    return {
        "particles": [
            {"body": {"name": "left", "mass": 1.0, "position": [-distance, 0, 0], "velocity": [1, 0, 0]}},
            {"body": {"name": "right", "mass": 1.0, "position": [distance, 0, 0], "velocity": [-1, 0, 0]}},
            {"body": {"name": "far", "mass": 0.0, "position": [50, 0, 0]}},
        ],
        "forces": [{"newtonian_gravity": {"strength": 1e-300}}],  # too weak to move them off the grid
        "integrator": {"leapfrog": {"dt": dt}},
    }


def weak(scene, precision):
    scene["forces"][0]["newtonian_gravity"]["strength"] = 1e-30 if precision == "f32" else 1e-300
    return scene


@pytest.mark.sampled(3)
@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize(("backend", "plan"), BACKENDS)
def test_a_zero_distance_is_named_with_its_step_and_pair(backend, plan, precision, request):
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    # Positions after the first half drift of step k: ∓1 ± (k − ½)·0.25; they meet at k = 4.5, so with dt/2 shifted at k = 5.
    scene = weak(head_on(dt=0.25, distance=1.125), precision)
    with Simulation(scene, backend=backend, precision=precision, plan=plan) as simulation:
        with pytest.raises(StabilityError) as caught:
            simulation.run(steps=100)
        assert caught.value.step == 5
        assert caught.value.time == pytest.approx(1.25)
        assert caught.value.particle in (0, 1)
        assert "left" in str(caught.value) and "right" in str(caught.value)
        assert "distance 0" in str(caught.value) and "softening" in str(caught.value)
        last_good = simulation.snapshot()
        assert simulation.step_count == 4 and np.isfinite(last_good.position).all()
        np.testing.assert_allclose(last_good.position[0], [-0.125, 0, 0], atol=1e-6)


@pytest.mark.parametrize(("backend", "plan"), BACKENDS)
@pytest.mark.sampled(3)
def test_a_planted_nan_is_found_on_every_backend(backend, plan, request):
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    with Simulation(cluster(20), backend=backend, plan=plan) as simulation:
        simulation.run(steps=137)
        assert simulation.launcher.first_bad_particle() == -1
        position, velocity = simulation.state.read()
        velocity[7, 1] = np.nan
        simulation.state.write(position, velocity)
        assert simulation.launcher.first_bad_particle() == 7
        for place, value in ((position, np.inf), (position, np.nan), (velocity, -np.inf), (velocity, np.nan)):
            sound = place[3, 0]
            place[3, 0] = value
            simulation.state.write(position, velocity)
            assert simulation.launcher.first_bad_particle() == 3
            place[3, 0] = sound


def test_softening_makes_the_same_encounter_finite():
    scene = head_on(distance=1.125)
    scene["forces"] = [{"newtonian_gravity": {"strength": 1.0, "softening": 0.1}}]
    with Simulation(scene, backend="cpu") as simulation:
        end = simulation.run(steps=100).snapshot()
    assert np.isfinite(end.position).all()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("broken_at", [1, 2, 3, 64, 100])
def test_bisection_finds_the_first_bad_step(broken_at):
    now, kept = [0], [0]

    def advance(count):
        now[0] += count
        return now[0] < broken_at

    def keep():
        kept[0] = now[0]

    def rewind():
        now[0] = kept[0]

    assert first_bad_step.first_bad_step(100, advance, keep, rewind) == broken_at
    assert now[0] == broken_at - 1


@pytest.mark.sampled(6)
def test_software_vulkan_is_not_trusted_with_more_loop_iterations_than_it_makes(software_vulkan):
    with Simulation(cluster(40), backend="vulkan", precision="f32", plan="serial") as simulation:
        limit = simulation.device.probes.loop_limit
        assert limit == 65535
        assert simulation.phase.launch_limit * simulation.launcher.loop_iterations_per_step() <= limit
        simulation.run(steps=300)
        end = simulation.snapshot()
    with Simulation(cluster(40), backend="cpu", precision="f32", plan="serial") as simulation:
        expected = simulation.run(steps=300).snapshot()
    np.testing.assert_allclose(end.position, expected.position, atol=1e-3)
    with pytest.raises(CapacityError, match="65,535"):
        Simulation(cluster(400), backend="vulkan", precision="f32", plan="serial")


def test_compensation_is_reported_as_it_is(software_vulkan):
    """The CPU keeps a compensated sum; software Vulkan is known to optimise it away."""
    assert backends.start("cpu", "f32").probes.compensation
    assert not backends.start("vulkan", "f32").probes.compensation


def test_f64_runs_compute_in_double_precision_on_every_backend_that_has_it(software_vulkan):
    for backend in ("cpu", "vulkan"):
        with Simulation(kepler(0.0, dt=0.001), backend=backend, precision="f64") as simulation:
            energy = simulation.diagnostics()["total_energy"]
            simulation.run(steps=200)
            # Leapfrog's truncation error on a circle is (dt)²/… ≈ 1e-7 of nothing: the energy of a circle stays to dt⁴ ~ 1e-12.
            assert abs(simulation.diagnostics()["total_energy"] / energy - 1.0) < 1e-11


def test_a_simulation_that_lost_its_runtime_says_so():
    first = Simulation(kepler(), backend="cpu", precision="f64")
    second = Simulation(kepler(), backend="cpu", precision="f32")
    with pytest.raises(MppError, match="has ended"):
        first.run(steps=1)
    second.run(steps=1)
    second.close()
    with pytest.raises(MppError, match="has ended"):
        second.snapshot()


def test_two_simulations_of_one_precision_live_side_by_side():
    with Simulation(kepler(), backend="cpu") as a, Simulation(kepler(0.5), backend="cpu") as b:
        a.run(steps=10)
        b.run(steps=10)
        a.run(steps=10)
        alone = a.snapshot()
    with Simulation(kepler(), backend="cpu") as a:
        assert np.array_equal(a.run(steps=20).snapshot().position, alone.position)


def test_a_backend_that_is_not_here_is_an_error_that_names_what_is(monkeypatch):
    from mpp_taichi.device import availability

    monkeypatch.setattr(availability, "_missing_library", lambda backend: "no driver is installed" if backend == "cuda" else "")
    with pytest.raises(BackendError, match=r"cuda does not start here: no driver.*cpu \("):
        Simulation(kepler(), backend="cuda")


def test_a_crash_of_the_trial_start_is_a_reason_and_not_a_crash(monkeypatch, tmp_path):
    from mpp_taichi.device import availability

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(availability, "_missing_library", lambda backend: "")
    monkeypatch.setattr(availability.sys, "executable", "/bin/false")
    report = availability.availability("vulkan")
    assert not report["available"] and "status 1" in report["reason"]
    assert not list(tmp_path.rglob("*.json")), "a failure must not be remembered"


def test_time_is_step_count_times_dt():
    with Simulation(kepler(dt=0.1), backend="cpu") as simulation:
        simulation.run(steps=100_000)
        assert simulation.time == 100_000 * 0.1
        simulation.run(until=10_000.55)
        assert simulation.time == pytest.approx(10_000.55, abs=1e-12) and simulation.step_count == 100_006
        simulation.run(duration=1.0)
        assert simulation.step_count == 100_016


def test_a_massless_body_does_not_change_a_bit_of_the_others():
    scene = kepler(0.4)
    with Simulation(scene, backend="cpu", plan="parallel") as simulation:
        alone = simulation.run(steps=50).snapshot()
    scene["particles"].append({"body": {"mass": 0.0, "position": [3, 3, 3]}})
    with Simulation(scene, backend="cpu", plan="parallel") as simulation:
        together = simulation.run(steps=50).snapshot()
    # The sums are taken in another order of lanes, so equality is to rounding.
    np.testing.assert_allclose(together.position[:2], alone.position, rtol=0, atol=50 * 10 * 2.0**-53)
