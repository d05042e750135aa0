"""The bath of heat: its random numbers, its temperature, its diffusion, its bits and its energy."""

import math

import numpy as np
import pytest
from repeated_runs import assert_copies_have_the_bits_of, run_with_a_way_back
from scipy import linalg, stats

from mpp_taichi import SceneError, Simulation
from mpp_taichi.device.backends import start
from mpp_taichi.errors import MppError, PrecisionError, UnsupportedError
from mpp_taichi.scene.load import load_scene

KT, GAMMA, MASS = 1.5, 0.7, 2.0
FALSE_ALARM = 1e-6  # of each comparison of a random number with its mean
SIGMAS = stats.norm.isf(FALSE_ALARM / 2)
WORDS = {  # of Philox4x32-10, by counter and key: from the file of known answers of the authors' library Random123
    ((0,) * 4, (0,) * 2): (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2): (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD),
    ((0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344), (0xA4093822, 0x299F31D0)): (
        *(0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
}


def bath(count=(10, 10, 10), *, dt=0.1, temperature=KT, friction=GAMMA, forces=(), **more):
    """Particles in a bath, which act on each other by no force."""
    upper = [0.9 if each > 1 else -0.9 for each in count]
    particles = {"lattice": {"shape": list(count), "lower": [-0.9] * 3, "upper": upper, "mass": MASS, "name": "gas"}}
    method = {"dt": dt, "temperature": temperature, "friction": friction}
    return {"particles": [particles], "forces": list(forces), "integrator": {"langevin": method | more}}


TRAP = {"harmonic_trap": {"frequencies": [1.0, 1.0, 1.0]}}


def run(scene, steps, *, backend="cpu", precision="f64", **more):
    with Simulation(scene, backend=backend, precision=precision, **more) as simulation:
        simulation.run(steps=steps)
        return simulation.snapshot()


def step_of_oscillator(dt, omega):
    """(M, C): a step of BAOAB maps (x, v) to M (x, v) and adds a noise of the covariance C, written down part by part."""
    kick = np.array([[1.0, 0.0], [-0.5 * dt * omega**2, 1.0]])
    drift = np.array([[1.0, 0.5 * dt], [0.0, 1.0]])
    c = math.exp(-GAMMA * dt)
    after = kick @ drift
    noise = after @ np.array([0.0, math.sqrt((1.0 - c * c) * KT / MASS)])
    return after @ np.diag([1.0, c]) @ drift @ kick, np.outer(noise, noise)


def test_the_words_are_those_that_the_authors_of_the_generator_publish():
    start("cpu", "f64")
    import taichi as ti
    from taichi.math import uvec2, uvec4

    from mpp_taichi.arithmetic.random_numbers import random_words

    @ti.kernel
    def words(counter: uvec4, key: uvec2) -> uvec4:
        return random_words(counter, key)

    for (counter, key), expected in WORDS.items():
        assert tuple(int(word) for word in words(uvec4(*counter), uvec2(*key))) == expected


@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
def test_the_numbers_are_normal_and_independent(backend):
    start(backend, "f32")
    import taichi as ti

    from mpp_taichi.arithmetic.random_numbers import normals_for

    particles, steps = 1000, 250

    @ti.kernel
    def fill(found: ti.types.ndarray(ndim=3)):
        for i, s in ti.ndrange(particles, steps):
            normals = normals_for(i, s, 12345)
            for k in ti.static(range(4)):
                found[i, s, k] = normals[k]

    found = np.zeros((particles, steps, 4), np.float32)
    fill(found)
    numbers = found.astype(np.float64)
    assert stats.kstest(numbers.ravel(), "norm").pvalue > FALSE_ALARM
    count = numbers.size
    for power, mean, variance in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        assert abs((numbers**power).mean() - mean) < SIGMAS * math.sqrt(variance / count), power
    for other in (np.roll(numbers, 1, 0), np.roll(numbers, 1, 1), np.roll(numbers, 1, 2), np.roll(numbers, 2, 2)):
        assert abs((numbers * other).mean()) < SIGMAS / math.sqrt(count)
        assert abs((numbers**2 * other**2).mean() - 1.0) < SIGMAS * math.sqrt(8.0 / count)


def test_without_friction_the_step_is_velocity_verlet():
    scene = bath((2, 2, 2), friction=0.0, forces=[TRAP])
    plain = scene | {"integrator": {"velocity_verlet": {"dt": 0.1}}}
    given, wanted = run(scene, 50), run(plain, 50)
    # Two half drifts are rounded once more than a drift, and 50 steps add these roundings up.
    assert np.abs(given.position - wanted.position).max() < 50 * 4 * np.finfo(float).eps


@pytest.mark.parametrize("dt", [0.1, 1.2])
def test_positions_in_a_harmonic_trap_have_the_variance_of_the_temperature_whatever_the_step_is(dt):
    matrix, noise = step_of_oscillator(dt, 1.0)
    exact = linalg.solve_discrete_lyapunov(matrix, noise)
    assert exact[0, 0] == pytest.approx(KT / MASS, rel=1e-12)  # the property for which the method is known
    assert exact[1, 1] == pytest.approx(KT / MASS * (1.0 - dt**2 / 4.0), rel=1e-12)
    found = run(bath((30, 30, 30), dt=dt, forces=[TRAP]), round(15.0 / dt))  # noise of 0.95 of its variance would be seen
    for values, variance in ((found.position, exact[0, 0]), (found.velocity, exact[1, 1])):
        # A mean of squares of n normal numbers has the relative variance 2/n. The start is forgotten after some
        # times 1/γ.
        assert abs((values**2).mean() / variance - 1.0) < SIGMAS * math.sqrt(2.0 / values.size)
    assert abs((found.position * found.velocity).mean()) < SIGMAS * KT / MASS / math.sqrt(found.position.size)


def test_free_particles_spread_as_einstein_says():
    dt, steps = 0.1, 300
    scene = bath((20, 10, 10), dt=dt)
    with Simulation(scene, backend="cpu") as simulation:
        start_of = simulation.snapshot().position
        simulation.run(steps=steps)
        found = ((simulation.snapshot().position - start_of) ** 2).mean()
    matrix, noise = step_of_oscillator(dt, 0.0)
    spread = np.zeros((2, 2))  # at rest, all at one place
    for _ in range(steps):
        spread = matrix @ spread @ matrix.T + noise
    time, diffusion = steps * dt, KT / (MASS * GAMMA)
    # Ornstein & Uhlenbeck (1930) for a start at rest; the step differs from it by a share of (γ dt)²/12.
    true = diffusion * (2.0 * time - (3.0 - 4.0 * math.exp(-GAMMA * time) + math.exp(-2.0 * GAMMA * time)) / GAMMA)
    assert spread[0, 0] == pytest.approx(true, rel=(GAMMA * dt) ** 2 / 6.0)
    assert abs(found / spread[0, 0] - 1.0) < SIGMAS * math.sqrt(2.0 / start_of.size)


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_the_bits_depend_neither_on_threads_nor_on_cuts_nor_on_other_copies(precision):
    scene = bath((3, 3, 3), forces=[TRAP, {"coulomb": {"softening": 0.1}}])
    scene["particles"].append({"body": {"mass": 1.0, "charge": 1.0, "position": [0.05, 0, 0]}})
    whole = run(scene, 60, precision=precision, plan="serial")
    for plan in ("serial", "parallel"):
        with Simulation(scene, backend="cpu", precision=precision, plan=plan) as simulation:
            found = run_with_a_way_back(simulation, 23, 12, 37)
            assert np.array_equal(found.position, whole.position)
            assert np.array_equal(found.velocity, whole.velocity)


def test_copies_have_the_bits_of_a_single_run():
    scene = bath((2, 2, 2), forces=[TRAP])
    assert_copies_have_the_bits_of(run(scene, 40), scene, copies=3, steps=40)


def test_noise_is_not_repeated_by_another_phase_or_another_seed():
    scene = bath((5, 5, 5))
    timeline = [{"at": 2.0, "set": {"integrator.langevin.temperature": KT * 1.0000001}}]
    plain, changed = run(scene, 40), run(scene | {"timeline": timeline}, 40)
    # The change is too small to be seen, unless the numbers of the first 20 steps came again.
    assert np.abs(plain.position - changed.position).max() < 1e-5
    other = run(bath((5, 5, 5), seed=2), 40)
    assert abs(np.corrcoef(plain.velocity.ravel(), other.velocity.ravel())[0, 1]) < SIGMAS / math.sqrt(plain.velocity.size)


def balance(scene, steps, **more):
    with Simulation(scene, backend="cpu", precision="f64", **more) as simulation:
        simulation.keep_energy_balance()
        simulation.run(steps=steps)
        return simulation.diagnostics()


def test_the_energy_that_the_bath_gives_is_booked_as_heat():
    free = balance(bath(), 200)
    assert free["heat"] == pytest.approx(free["kinetic_energy"], rel=1e-12)
    assert abs(free["energy_balance_residual"]) < 1e-12 * free["heat"]
    halves = [abs(balance(bath(dt=dt, forces=[TRAP]), round(8.0 / dt))["energy_balance_residual"]) for dt in (0.2, 0.1)]
    # Kick and drift lose or gain an energy of order dt² on the way: a quarter of it at half the step, and the rest is noise.
    assert halves[1] < 0.4 * halves[0]


def test_heat_before_the_balance_is_kept_does_not_count():
    with Simulation(bath(), backend="cpu", precision="f64") as simulation:
        before = simulation.run(steps=50).mechanics()["kinetic_energy"]
        simulation.keep_energy_balance()
        found = simulation.run(steps=50).diagnostics()
    assert found["heat"] == pytest.approx(found["kinetic_energy"] - before, rel=1e-9)
    assert abs(found["energy_balance_residual"]) < 1e-12 * before


def test_heat_is_kept_across_the_phases_of_a_timeline():
    timeline = [
        {"at": 2.0, "set": {"integrator.langevin.temperature": 3.0 * KT}},
        {"at": 4.0, "set": {"integrator": {"leapfrog": {"dt": 0.1}}}},
    ]
    found = balance(bath() | {"timeline": timeline}, 60)
    assert found["heat"] == pytest.approx(found["kinetic_energy"], rel=1e-12)
    assert abs(found["energy_balance_residual"]) < 1e-12 * found["heat"]


def test_held_axes_stay_at_rest_and_take_no_heat():
    scene = bath((2, 2, 2))
    scene["particles"][0]["lattice"]["free"] = [True, False, True]
    found = run(scene, 30)
    assert not found.velocity[:, 1].any() and found.velocity[:, 0].any()


@pytest.mark.parametrize("solver", ["swept", "pairwise", "simultaneous", "resting"])
def test_spheres_between_walls_come_to_the_temperature_of_the_bath(solver):
    scene = bath((7, 7, 7), dt=0.02)  # more than 300 spheres, so that `swept` sorts them into cells
    scene["particles"][0]["lattice"]["radius"] = 0.05
    scene |= {
        "walls": [{"box": {"lower": [-1, -1, -1], "upper": [1, 1, 1]}}],
        "contacts": {"hard_spheres": {"solver": solver}},
    }
    founds = [run(scene, 400, plan=plan) for plan in ("serial", "parallel")]
    assert np.array_equal(founds[0].velocity, founds[1].velocity)
    assert np.abs(founds[0].position).max() < 1.0
    found = MASS * (founds[0].velocity ** 2).mean()
    start_is_forgotten = math.exp(-2.0 * GAMMA * 8.0)  # the share of the start in the temperature, from rest
    assert abs(found / KT - 1.0) < SIGMAS * math.sqrt(2.0 / founds[0].velocity.size) + start_is_forgotten


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_vulkan_draws_the_same_noise(precision):
    scene = bath((4, 4, 4), forces=[TRAP])
    cpu, vulkan = (run(scene, 100, backend=backend, precision=precision) for backend in ("cpu", "vulkan"))
    # Sines and logarithms differ in the last places of f32, at most some 2⁻²¹ of a number on Vulkan, in each of 100 steps.
    assert np.abs(cpu.position - vulkan.position).max() < 100 * 2.0**-21


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"particles": [{"body": {"mass": 0.0, "position": [0, 0, 0]}}]}, SceneError, "has no mass, must have one above 0"),
        ({"integrator": {"langevin": {"dt": 0.1, "friction": 1.0}}}, SceneError, "missing key 'temperature'"),
        (
            {"integrator": {"langevin": {"dt": 0.1, "friction": 1.0, "temperature": -1.0}}},
            SceneError,
            r"temperature.*-1.*0 or more|temperature.*at least 0",
        ),
    ],
)
def test_what_has_no_bath_is_refused(change, error, message):
    with pytest.raises(error, match=message):
        Simulation(bath((1, 1, 1)) | change, backend="cpu")


def test_low_parts_and_steps_backwards_are_refused():
    with pytest.raises(PrecisionError, match="langevin does not carry low parts"):
        Simulation(bath((1, 1, 1)), backend="cpu", precision="ds")
    with Simulation(bath((2, 1, 1)), backend="cpu") as simulation:
        simulation.run(steps=2)
        simulation.dt = -simulation.dt
        with pytest.raises(UnsupportedError, match="no steps backwards"):
            simulation.run(steps=2)


def test_an_accuracy_study_is_refused(tmp_path, capsys):
    from mpp_taichi.accuracy.problem import pose

    with pytest.raises(MppError, match="accuracy compares motions, and langevin draws them at random"):
        pose(load_scene(bath((2, 1, 1)) | {"run": {"steps": 10}}))
