"""Pair forces and bodies for tests of the pair sums, with the same sums in plain NumPy in float64."""

import os

import numpy as np

from mpp_taichi.device import own_runtime
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.types import Template

os.environ["TI_SKIP_VERSION_CHECK"] = "ON"  # the check of `ti.init` calls a server
ti = import_taichi()


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
class State:
    carries_low = forces_see_low = forces_have_low = False
    number_kind = None

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
class Launcher:
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


def started(name, **options):
    with own_runtime.being_started():  # kernels of the package are compiled in its own runtimes only
        ti.init(arch=ti.cpu, default_fp=getattr(ti, name), fast_math=False, log_level=ti.ERROR, **options)
    yield getattr(ti, name)
    ti.reset()


def bodies_of(count, dimensions, precision, scale=1.0):
    """Positions, masses and charges that the precision holds exactly."""
    random = np.random.default_rng(count)
    kind = np.float32 if precision == ti.f32 else np.float64
    arrays = scale * random.random((count, dimensions)), 0.5 + random.random(count), random.normal(size=count)
    return [array.astype(kind).astype(np.float64) for array in arrays]


def reference(forces, position, mass, charge):
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


def rounding(count, precision):
    """Of a sum of `count` terms of some sixteen roundings each, relative to the sum of their absolute values."""
    return (count + 16) * (2.0**-24 if precision == ti.f32 else 2.0**-53)


def launcher_of(forces, bodies, precision):
    return Launcher(AllPairs(forces, len(bodies[0]), bodies[0].shape[1]), State(*bodies, precision))
