"""Plans and backends: every plan gives the same trajectory, and repeated runs give the same bits."""

import subprocess
import sys

import numpy as np
import pytest

from mpp_taichi import Simulation, component
from mpp_taichi.device.fast_taichi import lane_arithmetic
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.integrators._base import Integrator
from mpp_taichi.snapshot import Snapshot
from scenes import KINDS_OF_STEP, cluster, everything, irregular_network, kepler

PRECISIONS = {"f32": 2.0**-24, "f64": 2.0**-53}
SPLITTINGS = [name for name in KINDS_OF_STEP if component.declaration("integrators", name).base == "Splitting"]


def end_of(scene, *, steps=200, **options):
    with Simulation(scene, **options) as simulation:
        return simulation.run(steps=steps).snapshot()


def difference(a: Snapshot, b: Snapshot):
    return np.abs(a.position - b.position).max()


def end_and_growth(scene, steps, precision):
    """The end of a serial run in f64, and how far roundings of one in `precision` grow.

    That is twice the effect of moving every start position by one ulp, plus one ulp a step.
    """
    with Simulation(scene, backend="cpu", precision="f64", plan="serial") as simulation:
        end = simulation.run(steps=steps).snapshot()
        base = end.position
        simulation.restart()
        signs = np.where(np.random.default_rng(0).random(base.shape) < 0.5, -1.0, 1.0)
        nudge = 1e-7 * signs * simulation.start.free
        simulation.state.write(simulation.start.position + nudge, simulation.start.velocity * simulation.start.free)
        amplification = np.abs(simulation.run(steps=steps).snapshot().position - base).max() / 1e-7
    size = max(1.0, np.abs(base).max())
    # A rounding of half an ulp enters in each step of about ten operations, and later ones grow no more than the first.
    return end, 10 * steps * PRECISIONS[precision] * size * max(1.0, amplification)


# Single precision is the same text with another type: two methods stand for the others (test_springs asks more of them).
@pytest.mark.sampled(5)
@pytest.mark.parametrize(
    ("name", "precision"), [*((name, "f64") for name in KINDS_OF_STEP), ("leapfrog", "f32"), ("hermite4", "f32")]
)
def test_serial_and_parallel_agree_to_round_off(name, precision):
    scene = everything(integrator=name)
    serial, growth = end_and_growth(scene, 200, precision)
    if precision != "f64":
        serial = end_of(scene, backend="cpu", precision=precision, plan="serial")
    parallel = end_of(scene, backend="cpu", precision=precision, plan="parallel")
    assert difference(serial, parallel) <= growth


@pytest.mark.sampled(2)
@pytest.mark.parametrize("plan", ["serial", "parallel"])
@pytest.mark.parametrize("precision", PRECISIONS)
def test_vulkan_agrees_with_the_cpu_to_round_off(software_vulkan, precision, plan):
    for scene in (everything(), cluster(30)):
        here, growth = end_and_growth(scene, 50, precision)
        if precision != "f64":
            here = end_of(scene, backend="cpu", precision=precision, plan="serial", steps=50)
        there = end_of(scene, backend="vulkan", precision=precision, plan=plan, steps=50)
        assert 0 < np.abs(here.position - Simulation(scene, backend="cpu").start.position).max()
        assert difference(here, there) <= growth


# kahan_li6 stands for those of many stages, and for damped kicks with so many slopes that the parallel plan looks them up.
@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("integrator", "damping"),
    [*((name, c) for name in SPLITTINGS if name != "yoshida4" for c in (0.0, 0.3)), ("kahan_li6", 0.3)],
)
def test_steps_of_one_launch_that_share_a_loop_give_the_bits_of_single_ones(integrator, damping):
    scene = irregular_network(60, 150, damping=damping, integrator=integrator)
    with Simulation(scene, backend="cpu", plan="parallel") as simulation:
        simulation.run(steps=1)
        start = simulation.mark()
        simulation.launcher.advance(simulation.time, simulation.dt, 0, 20)
        together = simulation.snapshot()
        simulation.return_to(start)
        simulation.launcher.prepare(simulation.time, simulation.dt)
        for _ in range(20):
            simulation.launcher.advance(simulation.time, simulation.dt, 0, 1)
        assert np.array_equal(simulation.snapshot().position, together.position)
        assert np.array_equal(simulation.snapshot().velocity, together.velocity)
        assert difference(simulation.start, together) > 0


@pytest.mark.sampled(3)
@pytest.mark.parametrize("integrator", ["leapfrog", "yoshida4", "velocity_verlet"])
def test_steps_of_many_bodies_that_share_a_loop_give_the_bits_of_single_ones(integrator):
    """And, but for rounding, those of the serial plan: sums by lanes overwrite what was there, the last tile is not full."""
    scene = cluster(605, integrator=integrator)
    ends = []
    for at_once in (12, 1):
        with Simulation(scene, backend="cpu", plan="parallel") as simulation:
            simulation.launcher.prepare(0.0, simulation.dt)
            for _ in range(12 // at_once):
                simulation.launcher.advance(simulation.time, simulation.dt, 0, at_once)
            ends.append(simulation.snapshot())
    assert np.array_equal(ends[0].position, ends[1].position) and np.array_equal(ends[0].velocity, ends[1].velocity)
    serial, growth = end_and_growth(scene, 12, "f64")
    assert 0 < difference(serial, ends[0]) <= growth


@pytest.mark.sampled(3)
def test_stages_looked_up_by_the_parallel_plan_are_those_of_the_serial_one():
    scene = irregular_network(60, 150, damping=0.3, integrator="kahan_li6")
    ends = [end_of(scene, backend="cpu", plan=plan, steps=20) for plan in ("serial", "parallel")]
    # 20 steps of 9 stages, each some ten roundings of numbers up to 2, in a network that does not make them grow in 0.2.
    assert difference(*ends) <= 20 * 9 * 10 * 2 * PRECISIONS["f64"]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_the_same_run_twice_gives_the_same_bits(plan, dimensions):
    scene = cluster(70, dimensions=dimensions)
    runs = [end_of(scene, backend="cpu", plan=plan) for _ in range(3)]
    assert all(np.array_equal(runs[0].position, run.position) for run in runs[1:])
    assert all(np.array_equal(runs[0].velocity, run.velocity) for run in runs[1:])


def test_any_number_of_threads_gives_the_same_bits():
    code = (
        "import sys, hashlib; sys.path.insert(0, 'tests/support'); import scenes; from mpp_taichi import Simulation\n"
        "for name, precision in (('cluster', 'f32'), ('cluster', 'f64'), ('irregular_network', 'f32')):\n"
        "    options = dict(backend='cpu', precision=precision, plan='parallel', threads=int(sys.argv[1]))\n"
        "    with Simulation(getattr(scenes, name)(1100), **options) as s:\n"
        "        first = s.run(steps=5).snapshot().position.tobytes()\n"
        "        s.restart(); again = s.run(steps=5).snapshot().position.tobytes(); assert first == again\n"
        "    print(name, precision, hashlib.sha256(first).hexdigest())"
    )
    digests = {
        subprocess.run([sys.executable, "-c", code, threads], capture_output=True, text=True, check=True).stdout
        for threads in ("1", "3")
    }
    assert len(digests) == 1 and len(set(digests.pop().split())) == 2 + 2 + 3


@pytest.mark.sampled(3)
def test_two_dimensions_give_what_three_give_in_the_plane():
    flat = end_of(cluster(20, dimensions=2), backend="cpu", plan="serial")
    scene = cluster(20, dimensions=2) | {"dimensions": 3}
    spatial, growth = end_and_growth(scene, 200, "f64")
    assert difference(flat, spatial) <= growth


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", ["leapfrog", "rk4", "velocity_verlet"])
@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
def test_a_thousand_replicas_each_equal_their_single_run(name, backend, request):
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    scene = kepler(0.3, dt=0.02, integrator=name)
    random = np.random.default_rng(5)
    with Simulation(scene, backend=backend, precision="f64", plan="serial") as simulation:
        start = simulation.start
        starts = [
            start.moved(position=start.position, velocity=start.velocity * random.uniform(0.8, 1.1), time=0.0, step=0)
            for _ in range(1000)
        ]
        single = {}
        for k in (0, 1, 499, 998, 999):
            simulation.restart()
            simulation.state.write(starts[k].position, starts[k].velocity)
            single[k] = simulation.run(steps=300).snapshot()
    with Simulation(scene, backend=backend, precision="f64", replica_starts=starts) as ensemble:
        assert ensemble.plan == "replicas"
        ensemble.run(steps=300)
        for k, expected in single.items():
            found = ensemble.snapshot(replica=k)
            assert np.array_equal(found.position, expected.position)
            assert np.array_equal(found.velocity, expected.velocity)
        assert difference(ensemble.snapshot(replica=0), ensemble.snapshot(replica=1)) > 1e-3


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("name", "precision"), [("velocity_verlet", "f64"), ("rk4", "f32"), ("chin4a", "f64")])
def test_a_step_in_explicit_vectors_has_the_bits_of_one_without(name, precision, monkeypatch):
    monkeypatch.setattr(lane_arithmetic, "in_hardware", lambda *_, **__: False)  # products and sums rounded twice, as without
    scene = cluster(21, integrator=name)  # more than two tiles of f64, one and a part of f32
    scene["particles"][3]["body"]["free"] = [True, False, True]
    with Simulation(scene, backend="cpu", precision=precision, plan="serial") as simulation:
        assert simulation.launcher.compiled is explicit_vectors
        start = simulation.start
        ends = [simulation.run(steps=20).snapshot()]
    with Simulation(scene, backend="cpu", precision=precision, replica_starts=[start] * 3) as ensemble:
        assert ensemble.launcher.compiled is explicit_vectors
        ends.append(ensemble.run(steps=20).snapshot(replica=2))
    monkeypatch.setattr(Integrator, "in_vectors", lambda *_: False)
    ends.append(end_of(scene, steps=20, backend="cpu", precision=precision, plan="serial"))
    for end in ends[1:]:
        assert np.array_equal(end.position, ends[0].position)
        assert np.array_equal(end.velocity, ends[0].velocity)


def test_the_step_stands_once():
    """Only the base of all integrators, and that of those that iterate, define `step`; the plans are kernels around it."""
    from mpp_taichi.component import PACKAGE_FOLDER

    found = [path.stem for path in PACKAGE_FOLDER.rglob("*.py") if "def step(self, state" in path.read_text(encoding="utf-8")]
    assert sorted(found) == ["_base", "_implicit"]


def test_small_scenes_take_the_serial_plan_and_large_ones_the_parallel_plan():
    with Simulation(cluster(10), backend="cpu") as small:
        assert small.plan == "serial"
    with Simulation(cluster(1000), backend="cpu") as large:
        assert large.plan == "parallel"
