"""Laws of the direct pair sum: every loop shape, precision and size against plain NumPy in float64."""

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest

os.environ["TI_SKIP_VERSION_CHECK"] = "ON"  # the check of `import taichi` calls a server

import taichi as ti

from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.neighbors.explicit_vectors import is_elementwise
from mpp_taichi.types import Template

SHAPES = ("serial", "lanes", "launch", "gather")
ALL_SIZES = (1, 2, 3, 7, 63, 64, 65, 127, 128, 129, 255, 256, 257, 1025)
SOME_SIZES = (2, 7, 65)


class _InverseCube:
    """What gravity and charges share."""

    strength = 1.5

    def __init__(self, softening):
        self.softening = softening

    @ti.func
    def shape(self, inverse_distance):
        return inverse_distance * inverse_distance * inverse_distance


@ti.data_oriented
class Gravity(_InverseCube):
    @ti.func
    def response(self, state: Template, i):
        return ti.cast(self.strength, float)

    @ti.func
    def source(self, state: Template, j):
        return state.mass[j]

    @ti.func
    def potential(self, state: Template, i, j, inverse_distance):
        return -self.strength * ti.cast(state.mass[i], state.wide) * ti.cast(state.mass[j], state.wide) * inverse_distance

    def weights(self, mass, charge):
        return np.full(len(mass), self.strength), mass


@ti.data_oriented
class Charges(_InverseCube):
    @ti.func
    def response(self, state: Template, i):
        result = ti.cast(0.0, float)
        if state.charge[i] != 0.0:
            result = -self.strength * state.charge[i] / state.mass[i]
        return result

    @ti.func
    def source(self, state: Template, j):
        return state.charge[j]

    def weights(self, mass, charge):
        return -self.strength * charge / mass, charge


@ti.data_oriented
class Screened(Gravity):
    """A shape that is more than arithmetic: lanes must take it one by one."""

    @ti.func
    def shape(self, inverse_distance):
        return ti.exp(-1.0 / inverse_distance) * inverse_distance


@ti.data_oriented
class _State:
    carries_low = forces_see_low = False

    def __init__(self, position, mass, charge, precision, layout=None):
        count, self.dimensions = position.shape
        self.wide = ti.f64
        vector = {"dtype": precision, "shape": count, "layout": layout or ti.Layout.SOA}
        self.position = ti.Vector.field(self.dimensions, **vector)
        self.acceleration = ti.Vector.field(self.dimensions, **vector)
        self.mass = ti.field(precision, count)
        self.charge = ti.field(precision, count)
        kind = np.float32 if precision == ti.f32 else np.float64
        for field, values in ((self.position, position), (self.mass, mass), (self.charge, charge)):
            field.from_numpy(values.astype(kind))


@ti.data_oriented
class _Launcher:
    def __init__(self, pairs, state):
        self.pairs, self.state = pairs, state
        self.energies = ti.field(ti.f64, state.mass.shape)

    @ti.kernel
    def serial(self):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.pairs.accumulate_serial(self.state, 0)

    @ti.kernel
    def serial_from(self, first: ti.i32):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.pairs.accumulate_serial(self.state, first)

    @ti.kernel
    def lanes(self):
        self.pairs.accumulate_parallel_cpu(self.state)

    @ti.kernel
    def gather(self):
        self.pairs.accumulate_parallel_gather(self.state)

    @ti.kernel
    def energy(self):
        for i in range(self.pairs.particle_count):
            self.energies[i] = self.pairs.potential_energy_of(self.state, i)

    def launch(self):
        self.pairs.add_accelerations(self.state)

    def run(self, shape):
        """Accelerations by one loop shape, added to ones."""
        self.state.acceleration.fill(0)
        getattr(self, shape)()
        return self.state.acceleration.to_numpy().astype(np.float64)


@pytest.fixture(params=["f32", "f64"])
def precision(request):
    yield from _started(request.param)


def _started(name, **options):
    ti.init(arch=ti.cpu, default_fp=getattr(ti, name), fast_math=False, log_level=ti.ERROR, **options)
    yield getattr(ti, name)
    ti.reset()


def _bodies(count, dimensions, precision, scale=1.0):
    """Positions, masses and charges that the precision holds exactly."""
    random = np.random.default_rng(count)
    kind = np.float32 if precision == ti.f32 else np.float64
    arrays = scale * random.random((count, dimensions)), 0.5 + random.random(count), random.normal(size=count)
    return [array.astype(kind).astype(np.float64) for array in arrays]


def _reference(forces, position, mass, charge):
    """Accelerations in float64, and for each component the sum of the absolute terms, to measure rounding by."""
    total, scale = np.zeros_like(position), np.zeros_like(position)
    d = position[None] - position[:, None]
    squared = (d * d).sum(axis=-1)
    for force in forces:
        response, source = force.weights(mass, charge)
        softened = squared + force.softening**2
        np.fill_diagonal(softened, 1.0)
        terms = (response[:, None] * source[None] * softened**-1.5)[..., None] * d
        total += terms.sum(axis=1)
        scale += np.abs(terms).sum(axis=1)
    return total, scale


def _rounding(count, precision):
    """Of a sum of `count` terms of some sixteen roundings each, relative to the sum of their absolute values."""
    return (count + 16) * (2.0**-24 if precision == ti.f32 else 2.0**-53)


def _launcher(forces, bodies, precision):
    return _Launcher(AllPairs(forces, len(bodies[0]), bodies[0].shape[1]), _State(*bodies, precision))


CASES = {
    "gravity": (3, lambda: (Gravity(0.0),), ALL_SIZES),
    "softened gravity": (2, lambda: (Gravity(0.125),), SOME_SIZES),
    "gravity and charges": (3, lambda: (Gravity(0.0), Charges(0.0)), SOME_SIZES),
    "two softenings": (2, lambda: (Gravity(0.0), Charges(0.125)), SOME_SIZES),
}


@pytest.mark.parametrize("case", CASES)
def test_every_shape_gives_the_sum_over_all_pairs(case, precision):
    dimensions, make, sizes = CASES[case]
    if precision == ti.f32:
        sizes = [size for size in sizes if size in (*SOME_SIZES, 1025)]
    for size in sizes:
        forces, bodies = make(), _bodies(size, dimensions, precision)
        expected, scale = _reference(forces, *bodies)
        launcher = _launcher(forces, bodies, precision)
        for shape in SHAPES if size in SOME_SIZES else ("serial", "lanes", "gather"):
            error = np.abs(launcher.run(shape) - expected)
            assert (error <= 2 * _rounding(size, precision) * scale).all(), (shape, size)


def test_accelerations_are_added_to_what_is_there(precision):
    bodies = _bodies(20, 3, precision)
    launcher = _launcher((Gravity(0.5),), bodies, precision)
    for shape in SHAPES:
        once = launcher.run(shape)
        getattr(launcher, shape)()
        twice = launcher.state.acceleration.to_numpy()
        np.testing.assert_allclose(twice, 2 * once, rtol=0, atol=4 * _rounding(20, precision) * np.abs(once).max())


@pytest.mark.parametrize(("size", "charged"), [(5, True), (20, False), (21, True)])
def test_a_replica_feels_only_its_own_bodies(size, charged, precision):
    forces = (Gravity(0.0), Charges(0.0)) if charged else (Gravity(0.0),)
    bodies = _bodies(3 * size, 3, precision)
    middle = slice(size, 2 * size)
    expected, scale = _reference(forces, *(array[middle] for array in bodies))
    launcher = _Launcher(AllPairs(forces, size, 3), _State(*bodies, precision))
    launcher.serial_from(size)
    result = launcher.state.acceleration.to_numpy()
    assert (np.abs(result[middle] - expected) <= 2 * _rounding(size, precision) * scale).all()
    assert not result[:size].any() and not result[2 * size :].any()


def test_internal_forces_sum_to_zero(precision):
    forces, bodies = (Gravity(0.0), Charges(0.0)), _bodies(100, 3, precision)
    mass = bodies[1]
    _, scale = _reference(forces, *bodies)
    launcher = _launcher(forces, bodies, precision)
    for shape in SHAPES:
        total = mass @ launcher.run(shape)
        assert (np.abs(total) <= 2 * _rounding(100, precision) * (mass @ scale)).all(), shape


def test_own_launch_gives_the_bits_of_the_inlined_loop(precision):
    launcher = _launcher((Gravity(0.0), Charges(0.25)), _bodies(101, 3, precision), precision)
    np.testing.assert_array_equal(launcher.run("launch"), launcher.run("lanes"))


@pytest.mark.parametrize("size", [5, 20])
def test_bodies_at_one_place_are_never_silently_finite(size, precision):
    bodies = _bodies(size, 3, precision)
    launcher = _launcher((Gravity(0.0),), bodies, precision)
    for first, second in ((0, 1), (0, size - 1), (size // 2, size - 1)):
        position = bodies[0].copy()
        position[second] = position[first]
        launcher.state.position.from_numpy(position.astype(np.float32 if precision == ti.f32 else np.float64))
        met = np.zeros(size, bool)
        met[[first, second]] = True
        for shape in SHAPES:
            np.testing.assert_array_equal(np.isfinite(launcher.run(shape)).all(axis=1), ~met, err_msg=shape)


def test_softened_bodies_at_one_place_stay_finite(precision):
    bodies = _bodies(12, 3, precision)
    bodies[0][7] = bodies[0][2]
    launcher = _launcher((Gravity(0.5),), bodies, precision)
    for shape in SHAPES:
        assert np.isfinite(launcher.run(shape)).all(), shape


@pytest.mark.parametrize("scale", [1e-11, 1e12])
def test_single_precision_spans_atoms_and_planets(scale):
    for precision in _started("f32"):
        forces, bodies = (Gravity(0.0),), _bodies(70, 3, precision, scale)
        expected, terms = _reference(forces, *bodies)
        launcher = _launcher(forces, bodies, precision)
        for shape in SHAPES:
            assert (np.abs(launcher.run(shape) - expected) <= 2 * _rounding(70, precision) * terms).all(), shape


def test_potential_energy_is_float64_in_any_precision(precision):
    position, mass, charge = bodies = _bodies(70, 3, precision)
    launcher = _launcher((Gravity(0.125),), bodies, precision)
    launcher.energy()
    d = position[None] - position[:, None]
    inverse = ((d * d).sum(axis=-1) + 0.125**2) ** -0.5
    np.fill_diagonal(inverse, 0.0)
    expected = -0.75 * mass * (inverse @ mass)
    np.testing.assert_allclose(launcher.energies.to_numpy(), expected, rtol=_rounding(70, ti.f64))


def test_any_shape_of_force_runs_in_lanes(precision):
    assert is_elementwise(Gravity.shape)
    assert not is_elementwise(Screened.shape)
    launcher = _launcher((Screened(0.0),), _bodies(50, 3, precision), precision)
    np.testing.assert_array_equal(launcher.run("launch"), launcher.run("lanes"))
    np.testing.assert_allclose(launcher.run("launch"), launcher.run("gather"), rtol=0, atol=100 * _rounding(50, precision))


def test_explicit_vectors_refuse_interleaved_components():
    for precision in _started("f64"):
        state = _State(*_bodies(8, 3, precision), precision, ti.Layout.AOS)
        with pytest.raises(TypeError, match="component by component"):
            AllPairs((Gravity(0.0),), 8, 3).add_accelerations(state)


def test_explicit_vectors_are_switched_off_again():
    for precision in _started("f64"):
        config = ti.lang.impl.current_cfg()
        assert config.real_matrix_scalarize
        _launcher((Gravity(0.0),), _bodies(8, 3, precision), precision).launch()
        assert config.real_matrix_scalarize


def _digest(threads):
    """Hash of what the parallel shapes give, twice each, with so many threads."""
    digest = hashlib.sha256()
    for name in ("f32", "f64"):
        for precision in _started(name, cpu_max_num_threads=threads):
            launcher = _launcher((Gravity(0.0), Charges(0.25)), _bodies(1025, 3, precision), precision)
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
    for threads in (1, 2, 4):
        command = [sys.executable, "-c", program, str(threads)]
        result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=True)
        digests.add(result.stdout.split("digest ")[1])
    assert len(digests) == 1
