"""Hermite's schemes: jerk and snap of every force, order, near symmetry in time, plans, and refused scenes."""

import numpy as np
import pytest
import taichi as ti
from reference import accelerations
from scipy.integrate import solve_ivp

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.scene.integrator_checks import refused_formulas
from mpp_taichi.scene.load import load_scene
from scenes import cluster, everything, kepler

DERIVATIVES = {"hermite4": 1, "hermite6": 2}
DRIVE = {"force": [0.3, -0.2, 0.4], "angular_frequency": 2.0, "phase": 0.7, "of": 1}


def driven(integrator="hermite6", **changes):
    """Every force that has derivatives: gravity, charges, a uniform field, a drive, springs; an axis of one body is held."""
    scene = everything(integrator=integrator, drag=0.0, damping=0.0, **changes)
    scene["forces"] = [*scene["forces"], {"harmonic_drive": DRIVE}]
    return scene


def accelerations_of(start, *, drive=True):
    """a(x, t) by the textbook formulas, for real or complex places and times."""
    s, m, free = start.springs, start.mass, start.free

    def acceleration(x, t):
        a = accelerations.gravity(x, m, 0.7, 0.2) + accelerations.coulomb(x, m, start.charge, 0.5, 0.3)
        a = a + np.array([0.1, -0.2, -0.3])
        # The sum over springs adds into an array of the type that it is given.
        a = a + accelerations.springs(x, 0 * x, m, s.between, s.stiffness, 0 * s.damping, s.rest_length)
        a[1] += np.array(DRIVE["force"]) * np.sin(DRIVE["angular_frequency"] * t + DRIVE["phase"]) / m[1]
        return a * free

    return acceleration


def along(acceleration, x, v):
    """Acceleration, jerk and snap along the motion at t = 0: the jerk by a complex step, exact to rounding, the snap by central
    differences of jerks along x + v t + a t²/2 + j t³/6, with an error of 1e-4² times the next but one derivative."""

    def jerk(t):
        place = x + v * t + a * t**2 / 2 + j * t**3 / 6
        return acceleration(place + 1e-30j * (v + a * t + j * t**2 / 2), t + 1e-30j).imag / 1e-30

    a, j = acceleration(x, 0.0), np.zeros_like(x)
    j = jerk(0.0)
    return a, j, (jerk(1e-4) - jerk(-1e-4)) / 2e-4


@ti.data_oriented
class Gather:
    """The loop over pairs that GPUs run, on any backend."""

    def __init__(self, simulation):
        self.state, self.total_force = simulation.state, simulation.total_force

    @ti.kernel
    def sum(self):
        self.total_force.accumulate(self.state, 0, 0.0, "parallel")


def summed(scene, precision, shape):
    """What the forces of a scene give at its start, and the start."""
    plan = "serial" if shape == "serial" else "parallel"
    with Simulation(scene, backend="cpu", precision=precision, plan=plan) as simulation:
        simulation.launcher.prepare(0.0, simulation.dt)
        if shape == "gather":
            Gather(simulation).sum()
        found = [getattr(simulation.state, name).to_numpy().astype(float) for name in ("acceleration", "jerk", "snap")]
        return found, simulation.snapshot()


# One force in tiles of lanes from ten bodies on, several or few bodies pair by pair; lanes and gather with either. Single
# precision is the same text with another type, but for the number of lanes.
@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    ("kind", "shape", "precision"),
    [
        *((kind, shape, "f64") for kind in ("everything", "cluster") for shape in ("serial", "lanes", "gather")),
        ("everything", "serial", "f32"),
        ("cluster", "lanes", "f32"),
    ],
)
def test_jerk_and_snap_are_the_derivatives_of_the_acceleration(kind, shape, precision):
    if kind == "everything":
        scene = driven()
    else:
        scene = cluster(37, integrator="hermite6", softening=0.3)
        for k, entry in enumerate(scene["particles"]):
            entry["body"]["velocity"] = np.random.default_rng(k).uniform(-0.5, 0.5, 3).tolist()
    found, start = summed(scene, precision, shape)
    formula = accelerations_of(start)
    if kind == "cluster":

        def formula(x, t):
            return accelerations.gravity(x, start.mass, 1.0, 0.3)

    expected = along(formula, start.position, start.velocity)
    # Some forty terms of size up to that of the largest, each rounded some ten times; the difference quotient errs by some
    # 1e-8 d⁵x/dt⁵, rounding of its jerks by 1e-16/1e-4.
    rounding = 400 * {"f64": 2.0**-53, "f32": 2.0**-24}[precision]
    for k, (got, want) in enumerate(zip(found, expected)):
        np.testing.assert_allclose(got, want, rtol=0, atol=(rounding + (3e-6 if k == 2 else 0.0)) * np.abs(want).max())
        assert np.abs(want).max() > 0.1
    if kind == "everything":
        assert all(got[0, 2] == 0.0 for got in found)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("corrections", [1, 3])
@pytest.mark.parametrize("name", DERIVATIVES)
def test_order_beside_every_force(name, corrections):
    """Driven springs, charges and gravity against SciPy's DOP853 by the textbook formulas."""
    counts = {
        ("hermite4", 1): (512, 2048),
        ("hermite4", 3): (160, 512),
        ("hermite6", 1): (128, 512),
        ("hermite6", 3): (192, 384),
    }
    low, high = counts[name, corrections]
    scene = driven(name, dt=0.01)
    scene["integrator"][name]["corrections"] = corrections
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        start = simulation.snapshot()
        formula = accelerations_of(start)

        def slopes(t, y):
            x, v = y.reshape(2, -1, 3)
            return np.concatenate([v.ravel(), formula(x, t).ravel()])

        y = np.concatenate([start.position.ravel(), start.velocity.ravel()])
        expected = solve_ivp(slopes, (0.0, 1.0), y, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
        steps = np.geomspace(low, high, 4).round().astype(int)
        errors = []
        for count in steps:
            simulation.dt = 1.0 / count
            simulation.restart()
            simulation.run(steps=int(count))
            end = simulation.snapshot()
            errors.append(np.linalg.norm(np.concatenate([end.position.ravel(), end.velocity.ravel()]) - expected))
    assert errors[-1] > 1e-12, "the ladder reaches round-off and shows nothing"
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(int(name[-1]), abs=0.1)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", DERIVATIVES)
def test_corrections_make_it_nearly_symmetric_in_time(name):
    """200 orbits of e = 0.3 in steps of 1/125: corrected once the energy drifts, corrected three times it does not."""
    ratios, errors = [], []
    for corrections in (1, 3):
        scene = kepler(0.3, dt=0.05, integrator=name, corrections=corrections)
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            energy, found = simulation.diagnostics()["total_energy"], []
            for _ in range(100):
                simulation.run(steps=269)
                found.append(abs(simulation.diagnostics()["total_energy"] / energy - 1.0))
        ratios.append(max(found[-10:]) / max(found[:10]))
        errors.append(max(found))
    assert ratios[0] > 5.0 and ratios[1] < 1.1
    assert errors[1] < 0.1 * errors[0]


@pytest.mark.parametrize("name", DERIVATIVES)
@pytest.mark.sampled(3)
def test_replicas_and_going_back_give_the_same_bits(name):
    scene = kepler(0.5, dt=0.02, integrator=name)
    with Simulation(scene, backend="cpu", precision="f64", plan="serial") as simulation:
        start = simulation.snapshot()
        mark = simulation.run(steps=50).mark()
        alone = simulation.run(steps=50).snapshot()
        simulation.return_to(mark)
        # What was evaluated last belongs to the state before its correction, so it cannot be evaluated anew.
        assert np.array_equal(simulation.run(steps=50).snapshot().position, alone.position)
    slower = start.moved(position=start.position, velocity=0.9 * start.velocity, time=0.0, step=0)
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=[slower, start]) as simulation:
        simulation.run(steps=100)
        assert np.array_equal(simulation.snapshot(1).position, alone.position)
        assert not np.array_equal(simulation.snapshot(0).position, alone.position)


@pytest.mark.sampled(3)
def test_the_parallel_plan_of_a_gpu_agrees_with_the_cpu(software_vulkan):
    scene = cluster(30, integrator="hermite6", softening=0.3)
    ends = []
    for backend, plan in (("cpu", "serial"), ("vulkan", "parallel")):
        with Simulation(scene, backend=backend, precision="f64", plan=plan) as simulation:
            ends.append(simulation.run(steps=20).snapshot().position)
    # 20 steps of 2 evaluations of 30 terms, of numbers up to 1, whose rounding hardly grows in a time of 0.2.
    assert np.abs(ends[0] - ends[1]).max() < 20 * 2 * 30 * 2.0**-52


FORCE = '''"""A screened force, without derivatives."""
import taichi as ti
from mpp_taichi.component import component
from mpp_taichi.forces._base import PairForce

@component
class Screened(PairForce):
    """Screened attraction."""
'''


def test_forces_without_derivatives_are_refused_by_name(tmp_path):
    (tmp_path / "forces").mkdir()
    (tmp_path / "forces" / "screened.py").write_text(FORCE, encoding="utf-8")
    component.extra_folders.append(tmp_path)
    try:
        scene = kepler(integrator="hermite4", forces=[{"screened": {}}])
        with pytest.raises(
            SceneError, match="hermite4: needs the derivative of every force, which screened lacks, allowed: coul"
        ):
            load_scene(scene)
        # The accuracy sweep asks the same before it tries a method on a scene.
        assert refused_formulas("hermite6", load_scene(kepler(integrator="leapfrog", forces=[{"screened": {}}])))
    finally:
        component.extra_folders.remove(tmp_path)
    for other in ({"drag": 0.2, "damping": 0.0}, {"drag": 0.0, "damping": 0.3}):
        scene = everything(integrator="leapfrog", **other)
        scene["integrator"] = {"hermite6": {"dt": 0.01}}
        with pytest.raises(
            SceneError, match="hermite6: would lose its order beside (linear_drag|damped springs), for it takes no"
        ):
            Simulation(scene, backend="cpu")
    with pytest.raises(SceneError, match="corrections.*at least 1"):
        load_scene(kepler(integrator="hermite4", corrections=0))
