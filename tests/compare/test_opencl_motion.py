"""Runs in OpenCL agree with runs of the program to round-off, for each integrator and each force."""

import numpy as np
import pytest
from opencl_models import UNIT, bodies, change_kernel, gravity_spec, loaded

from mpp_taichi import Simulation
from scenes import cluster, everything, irregular_network

INTEGRATORS = ["leapfrog", "velocity_verlet", "rk4"]
STEPS = 20
OPERATIONS = 40  # that round a number in a step, generously: stages, and the sums of the forces on a particle
SIZE = 4.0  # of no scene here is a place, a speed or a change of it in a step larger
SCENES = {
    "all forces": lambda integrator: everything(integrator=integrator),
    "full damping": lambda integrator: everything(integrator=integrator) | {"spring_damping": "full"},
    "springs": lambda integrator: irregular_network(100, 300, damping=0.0, integrator=integrator),
    "damped springs": lambda integrator: irregular_network(100, 300, integrator=integrator),
    "gravity in the plane": lambda integrator: cluster(40, integrator=integrator, dimensions=2),
    "drag": lambda integrator: everything(integrator=integrator, damping=0.0),
}


def growth(spec, particles):
    """Of a perturbation over the run, exp(ω t) at most.

    ω² ≤ 2 Σ D/m of the springs, plus 300 for gravity and charges: 4 G M/r³ with G M ≤ 4, charges less, and r ≥ 0.4 or ε where
    it matters. Friction takes from it what it turns.
    """
    springs = particles.springs
    pull = np.bincount(springs.between.ravel(), np.repeat(springs.stiffness, 2), particles.particle_count) / particles.mass
    pairs = 300.0 if spec.forces else 0.0
    return np.exp(np.sqrt(2 * pull.max() + pairs) * STEPS * spec.integrator.parameters["dt"])


# Of each kernel once: those of the stages differ by integrator, those of the forces do not.
CASES = [(name, integrator) for name in ("all forces", "springs", "damped springs") for integrator in INTEGRATORS]
CASES += [(name, "leapfrog") for name in ("full damping", "gravity in the plane", "drag")]


@pytest.mark.sampled(6)
@pytest.mark.parametrize(("name", "integrator"), CASES)
def test_a_run_is_the_programs_own(opencl, name, integrator):
    """The program's in f64, beside both precisions of OpenCL: the bound of f32 is what f32 alone rounds."""
    spec, start = loaded(SCENES[name](integrator))
    with Simulation(spec, backend="cpu", precision="f64", plan="serial") as simulation:
        expected = simulation.run(steps=STEPS).snapshot()
    for precision in ("f64", "f32"):
        limit = STEPS * OPERATIONS * SIZE * UNIT[precision] * growth(spec, start)
        with opencl.Runner(spec, start, precision=precision) as runner:
            runner.advance(7)
            assert runner.advance(STEPS - 7) > 0.0
            found = runner.snapshot()
        assert np.abs(found.position - expected.position).max() < limit
        assert np.abs(found.velocity - expected.velocity).max() < limit
        assert np.abs(expected.velocity - start.velocity).max() > 20 * limit
        assert (found.time, found.step) == (expected.time, expected.step)


def test_run_is_a_runner_and_its_steps(opencl):
    spec, start = loaded(cluster(20))
    with opencl.Runner(spec, start) as runner:
        runner.advance(5)
        expected = runner.snapshot()
        runner.restart(start)
        runner.advance(0)
        assert np.array_equal(runner.snapshot().position, start.position)
    found = opencl.run(spec, start, 5, precision="f64")
    assert np.array_equal(found.position, expected.position) and np.array_equal(found.velocity, expected.velocity)


def test_all_variants_lead_the_same_way(opencl):
    """Sums of 300 bodies in different orders, over 10 steps of a motion that nothing drives apart: ω² ≤ 4 G M/ε³ = 600."""
    spec, start = gravity_spec(1.0), bodies(300)
    ways = []
    for variant in ("naive", "tiled", "vectors", "third_law", "vectors seeded"):
        with opencl.Runner(spec, start, variant=variant) as runner:
            assert runner.variant.startswith(f"pairs: {variant.split()[0]}")
            runner.advance(10)
            ways.append(runner.snapshot())
    # G M = 150 pulls by at most 150 within a radius of ε; each of 300 terms is rounded.
    limit = 10 * 0.01 * 150 * 300 * UNIT["f64"] * np.exp(np.sqrt(600) * 0.1)
    for way in ways[1:]:
        assert np.abs(way.velocity - ways[0].velocity).max() < limit
    assert np.abs(ways[0].velocity - start.velocity).max() > 0.1


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_launches_of_a_step_are_as_many_as_it_says(opencl, integrator):
    for scene in (everything(integrator=integrator), cluster(10, integrator=integrator)):
        spec, start = loaded(scene)
        with opencl.Runner(spec, start) as runner:
            memory, counts = runner._memory, []
            runner.advance(1)  # sums that a first step alone needs
            for steps in (10, 20):
                before = memory.launches
                runner.advance(steps)
                counts.append(memory.launches - before)
        assert counts[1] - counts[0] == 10 * runner.launches_per_step


FAULTS = {
    "a kick too short": ("motion", "const REAL4 faster = moving + kick * a;", "const REAL4 faster = moving + kick / 2 * a;"),
    "a place not noted": ("motion", "    columns[i] = place.x;\n", ""),
    "friction of the start alone": ("motion", "braking(i, here, middle[i], x, middle, PASS_FORCES)", "(REAL4)(0)"),
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_a_step_is_seen(opencl, fault, monkeypatch):
    """Against the same kernels as they should be; twenty steps of a hundredth show what one fault does."""
    scene = irregular_network(100, 300) if "friction" in fault else cluster(40)
    spec, start = loaded(scene)
    expected = opencl.run(spec, start, STEPS)
    change_kernel(monkeypatch, *FAULTS[fault])
    found = opencl.run(spec, start, STEPS)
    limit = STEPS * OPERATIONS * SIZE * UNIT["f32"] * growth(spec, start)
    assert np.abs(found.velocity - expected.velocity).max() > limit
