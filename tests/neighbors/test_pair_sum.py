"""Laws of the direct pair sum: every loop shape, precision and size against plain NumPy in float64."""

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
import taichi as ti
from conftest import ROOT
from pair_sums import Charges, Gravity, Launcher, Screened, State, bodies_of, launcher_of, reference, rounding, started

from mpp_taichi.device.fast_taichi import lane_arithmetic
from mpp_taichi.device.fast_taichi.explicit_vectors import is_elementwise
from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.scene.load import load_scene
from mpp_taichi.simulation.simulation import Simulation

SHAPES = ("serial", "lanes", "launch", "gather")
ALL_SIZES = (1, 2, 3, 7, 63, 64, 65, 256, 257, 1025)  # around full registers of 8 and 16 numbers, and what a GPU gathers
SOME_SIZES = (2, 7, 65)


@pytest.fixture(params=["f32", "f64"])
def precision(request):
    yield from started(request.param)


CASES = {
    "gravity": (3, lambda: (Gravity(0.0),), ALL_SIZES),
    "softened gravity": (2, lambda: (Gravity(0.125),), SOME_SIZES),
    "gravity and charges": (3, lambda: (Gravity(0.0), Charges(0.0)), SOME_SIZES),
    "two softenings": (2, lambda: (Gravity(0.0), Charges(0.125)), SOME_SIZES),
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("case", CASES)
def test_every_shape_gives_the_sum_over_all_pairs(case, precision):
    dimensions, make, sizes = CASES[case]
    if precision == ti.f32:
        sizes = [size for size in sizes if size in (*SOME_SIZES, 1025)]
    for size in sizes:
        forces, bodies = make(), bodies_of(size, dimensions, precision)
        expected, scale = reference(forces, *bodies)
        launcher = launcher_of(forces, bodies, precision)
        for shape in SHAPES if size in SOME_SIZES else ("serial", "lanes", "gather"):
            error = np.abs(launcher.run(shape) - expected)
            assert (error <= 2 * rounding(size, precision) * scale).all(), (shape, size)


@pytest.mark.sampled(3)
def test_accelerations_are_added_to_what_is_there(precision):
    bodies = bodies_of(20, 3, precision)
    launcher = launcher_of((Gravity(0.5),), bodies, precision)
    for shape in SHAPES:
        once = launcher.run(shape)
        getattr(launcher, shape)()
        twice = launcher.state.acceleration.to_numpy()
        np.testing.assert_allclose(twice, 2 * once, rtol=0, atol=4 * rounding(20, precision) * np.abs(once).max())


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("size", "charged"), [(5, True), (20, False), (21, True)])
def test_a_replica_feels_only_its_own_bodies(size, charged, precision):
    forces = (Gravity(0.0), Charges(0.0)) if charged else (Gravity(0.0),)
    bodies = bodies_of(3 * size, 3, precision)
    middle = slice(size, 2 * size)
    expected, scale = reference(forces, *(array[middle] for array in bodies))
    launcher = Launcher(AllPairs(forces, size, 3), State(*bodies, precision))
    launcher.serial_from(size)
    result = launcher.state.acceleration.to_numpy()
    assert (np.abs(result[middle] - expected) <= 2 * rounding(size, precision) * scale).all()
    assert not result[:size].any() and not result[2 * size :].any()


@pytest.mark.sampled(3)
def test_internal_forces_sum_to_zero(precision):
    forces, bodies = (Gravity(0.0), Charges(0.0)), bodies_of(100, 3, precision)
    mass = bodies[1]
    _, scale = reference(forces, *bodies)
    launcher = launcher_of(forces, bodies, precision)
    for shape in SHAPES:
        total = mass @ launcher.run(shape)
        assert (np.abs(total) <= 2 * rounding(100, precision) * (mass @ scale)).all(), shape


@pytest.mark.sampled(3)
def test_own_launch_gives_the_bits_of_the_inlined_loop(precision, monkeypatch):
    monkeypatch.setattr(lane_arithmetic, "in_hardware", lambda *_, **__: False)  # which only the launch would use
    launcher = launcher_of((Gravity(0.0), Charges(0.25)), bodies_of(101, 3, precision), precision)
    np.testing.assert_array_equal(launcher.run("launch"), launcher.run("lanes"))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("size", [5, 20])
def test_bodies_at_one_place_are_never_silently_finite(size, precision):
    bodies = bodies_of(size, 3, precision)
    launcher = launcher_of((Gravity(0.0),), bodies, precision)
    for first, second in ((0, 1), (0, size - 1), (size // 2, size - 1)):
        position = bodies[0].copy()
        position[second] = position[first]
        launcher.state.position.from_numpy(position.astype(np.float32 if precision == ti.f32 else np.float64))
        met = np.zeros(size, bool)
        met[[first, second]] = True
        for shape in SHAPES:
            np.testing.assert_array_equal(np.isfinite(launcher.run(shape)).all(axis=1), ~met, err_msg=shape)


@pytest.mark.sampled(3)
def test_softened_bodies_at_one_place_stay_finite(precision):
    bodies = bodies_of(12, 3, precision)
    bodies[0][7] = bodies[0][2]
    launcher = launcher_of((Gravity(0.5),), bodies, precision)
    for shape in SHAPES:
        assert np.isfinite(launcher.run(shape)).all(), shape


@pytest.mark.parametrize("scale", [1e-11, 1e12])
@pytest.mark.sampled(3)
def test_single_precision_spans_atoms_and_planets(scale):
    for precision in started("f32"):
        forces, bodies = (Gravity(0.0),), bodies_of(70, 3, precision, scale)
        expected, terms = reference(forces, *bodies)
        launcher = launcher_of(forces, bodies, precision)
        for shape in SHAPES:
            assert (np.abs(launcher.run(shape) - expected) <= 2 * rounding(70, precision) * terms).all(), shape


def test_potential_energy_is_float64_in_any_precision(precision):
    position, mass, charge = bodies = bodies_of(70, 3, precision)
    launcher = launcher_of((Gravity(0.125),), bodies, precision)
    launcher.energy()
    d = position[None] - position[:, None]
    inverse = ((d * d).sum(axis=-1) + 0.125**2) ** -0.5
    np.fill_diagonal(inverse, 0.0)
    expected = -0.75 * mass * (inverse @ mass)
    np.testing.assert_allclose(launcher.energies.to_numpy(), expected, rtol=rounding(70, ti.f64))


@pytest.mark.sampled(3)
def test_forces_of_any_shape_are_evaluated_in_lanes(precision, monkeypatch):
    monkeypatch.setattr(lane_arithmetic, "in_hardware", lambda *_, **__: False)
    assert is_elementwise(Gravity.shape)
    assert not is_elementwise(Screened.shape)
    launcher = launcher_of((Screened(0.0),), bodies_of(50, 3, precision), precision)
    np.testing.assert_array_equal(launcher.run("launch"), launcher.run("lanes"))
    np.testing.assert_allclose(launcher.run("launch"), launcher.run("gather"), rtol=0, atol=100 * rounding(50, precision))


def test_explicit_vectors_refuse_interleaved_components():
    for precision in started("f64"):
        state = State(*bodies_of(8, 3, precision), precision, ti.Layout.AOS)
        with pytest.raises(TypeError, match="component by component"):
            AllPairs((Gravity(0.0),), 8, 3).add_accelerations(state)


def test_explicit_vectors_are_switched_off_again():
    for precision in started("f64"):
        config = ti.lang.impl.current_cfg()
        assert config.real_matrix_scalarize
        launcher_of((Gravity(0.0),), bodies_of(8, 3, precision), precision).launch()
        assert config.real_matrix_scalarize


def _digest(threads):
    """Hash of what the parallel shapes give, twice each, with so many threads."""
    digest = hashlib.sha256()
    for name in ("f32", "f64"):
        for precision in started(name, cpu_max_num_threads=threads):
            launcher = launcher_of((Gravity(0.0), Charges(0.25)), bodies_of(501, 3, precision), precision)
            for shape in ("lanes", "launch", "gather"):
                once = launcher.run(shape)
                assert once.tobytes() == launcher.run(shape).tobytes()
                digest.update(once.tobytes())
    return digest.hexdigest()


def test_bits_do_not_depend_on_the_number_of_threads():
    program = "import sys; from test_pair_sum import _digest; print('digest', _digest(int(sys.argv[1])))"
    folder = os.path.dirname(__file__)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([folder, os.path.dirname(folder)])}
    digests = set()
    for threads in (1, 3):
        command = [sys.executable, "-c", program, str(threads)]
        result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=True)
        digests.add(result.stdout.split("digest ")[1])
    assert len(digests) == 1


@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
@pytest.mark.sampled(3)
def test_forces_in_f32_are_right_to_5e_6_of_the_largest(backend, request):
    """A ring around its planet: thousands of small pulls beside a large one, which all could be rounded the same way."""
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    spec = load_scene(ROOT / "scenes" / "ring.yaml")
    with Simulation(spec, backend=backend, precision="f32", plan="parallel") as simulation:
        from mpp_taichi.compare.felt_forces import FeltForces

        found = FeltForces(simulation.state, simulation.total_force, simulation.launcher.force_sum).measure(0.0)
        position, _ = simulation.state.read()
        mass = simulation.state.mass.to_numpy()[: len(position)].astype(float)
    gravity = spec.forces[0].parameters
    expected = np.empty((len(position), 3))
    for i, place in enumerate(position):
        d = position - place
        squared = (d * d).sum(1) + gravity["softening"] ** 2
        squared[i] = np.inf
        expected[i] = gravity["strength"] * (mass / squared**1.5) @ d
    largest = np.abs(expected).max()
    assert np.abs(found - expected[:, : found.shape[1]]).max() < 5e-6 * largest
