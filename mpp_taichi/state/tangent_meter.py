"""Tangent meter: the growth of a small deviation along the run of each replica, measured after every step in the kernel."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device import bulk_copy
from mpp_taichi.state.lane_state import MOVED, PREFIX
from mpp_taichi.state.tangent_growth import TangentGrowth
from mpp_taichi.types import Template

SEED = 1  # of the direction of the deviation at the start, the same for every run
RANGE_BITS = 40  # |δ| is kept between 2⁻⁴⁰ and 2⁴⁰, whose squares an f32 has
SUMS = ("elapsed", "growth", "shift", "growth_integral", "megno_integral", "largest_growth")


@ti.data_oriented
class TangentMeter:
    """The deviation of each replica, and the integrals of its growth by the trapezoidal rule over the steps.

    With δ̇·δ/δ² = dL/dt, Y(t) = (2/t) ∫ (dL/ds) s ds = 2 (L − (1/t) ∫ L ds). Source: Cincotta & Simó, Astron. Astrophys. Suppl.
    147 (2000) 205; Cincotta, Giordano & Simó, Physica D 182 (2003) 151; the indicator max L: Froeschlé, Lega & Gonczi, Celest.
    Mech. Dyn. Astron. 67 (1997) 41.
    """

    def __init__(self, state: Any, free: np.ndarray, copies: int, *, on_cpu: bool) -> None:
        """Name the fields.

        free     the axes along which each particle may move, (particle_count, 3)
        copies   replicas of each system: one, or as many as `copies_of` gives
        on_cpu   whether the device is the CPU; on a GPU the logarithm is taken in f32, and L is exact to 10⁻⁶
        """
        self.state, self.copies, self.single_logarithm = state, copies, not on_cpu
        self.free = np.asarray(free)[:, : state.dimensions] != 0
        self.deviation = tuple(getattr(state, PREFIX + name) for name in MOVED)
        self.sums = {name: getattr(state, PREFIX + name) for name in SUMS}

    @staticmethod
    def work_fields() -> dict[str, tuple[str, int]]:
        """The sums, as work fields of the state."""
        return {PREFIX + name: ("wide", 1) for name in SUMS}

    @staticmethod
    def memory() -> tuple[str, ...]:
        """The names of the fields that a saved state has."""
        return tuple(PREFIX + name for name in ("position", "velocity", *SUMS))

    def begin(self) -> None:
        """Begin at the start of the run with |δ| = 1: the first copy in a random direction, each other along one free axis."""
        state = self.state
        start = np.random.default_rng(SEED).standard_normal((2, state.particle_count, 3))[:, :, : state.dimensions] * self.free
        starts = (start / (np.sqrt((start**2).sum()) or 1.0))[None]
        if self.copies > 1:
            axes = np.eye(start.size).reshape(-1, *start.shape)[np.tile(self.free.ravel(), 2)]
            starts = np.concatenate([starts, axes])
        self.write(starts[:, 0], starts[:, 1])

    def write(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """Set the deviations of any length, and begin the sums anew.

        They are (particle_count, dimensions) of every replica, or (copies, particle_count, dimensions).
        """
        shape = (-1, self.state.particle_count, self.state.dimensions)
        position, velocity = (np.reshape(each, shape) for each in (position, velocity))
        length = np.sqrt((position**2).sum(axis=(1, 2)) + (velocity**2).sum(axis=(1, 2)))
        times, count = self.state.replica_count // len(length), self.state.total_count
        arrays = [np.tile(each, (times, 1, 1)).reshape(count, -1) for each in (position, velocity)]
        bulk_copy.write(list(self.deviation[:2]), arrays)
        for field in self.sums.values():
            field.fill(0.0)
        shift = np.tile(-np.log(np.where(length > 0.0, length, 1.0)), times)
        self.sums["shift"].from_numpy(shift.astype(np.float32 if self.state.wide == ti.f32 else np.float64))

    def read(self) -> TangentGrowth:
        """The growth of every system now, that of its first copy."""
        sums = (self.sums[name].to_numpy().astype(np.float64)[:: self.copies] for name in SUMS)
        elapsed, growth, _, _, integral, largest = sums
        with np.errstate(divide="ignore", invalid="ignore"):
            megno = np.where(elapsed > 0.0, integral / elapsed, 0.0)
        return TangentGrowth(elapsed, growth, largest, megno, self._read_derivative() if self.copies > 1 else None)

    def _read_derivative(self) -> np.ndarray:
        """The derivative of each system, (systems, m, m): its columns are the deviations of the other copies."""
        shape = (-1, self.copies, self.state.particle_count, self.state.dimensions)
        with np.errstate(over="ignore", invalid="ignore"):
            position, velocity = (each.reshape(shape)[:, 1:, self.free] for each in self.read_deviation())
        return np.concatenate([position, velocity], axis=2).transpose(0, 2, 1)

    def read_deviation(self) -> tuple[np.ndarray, np.ndarray]:
        """δ of positions and velocities of every replica in units of its length at the start, (total_count, dimensions)."""
        position, velocity = (field.to_numpy().astype(np.float64) for field in self.deviation[:2])
        scale = np.repeat(np.exp(self.sums["shift"].to_numpy().astype(np.float64)), self.state.particle_count)[:, None]
        return position * scale, velocity * scale

    @ti.kernel
    def measure_alone(self, dt: float, scaled: ti.i32) -> float:
        """`measure` in a kernel of its own, for one replica whose deviation was `scaled` times divided by 2**RANGE_BITS.

        Returns the factor by which the deviation is multiplied now.
        """
        factor = 1.0
        ti.loop_config(serialize=True)
        for replica in range(1):
            self.sums["shift"][replica] += scaled * ti.static(RANGE_BITS * float(np.log(2.0)))
            factor = ti.cast(self.measure(replica, dt), float)
        return factor

    @ti.func
    def measure(self, replica, dt):
        """Add a step of the length dt to the sums of a replica, after the step; the factor that keeps |δ| in its range."""
        first = replica * self.state.particle_count
        factor = self.add(replica, dt, self.squared(replica))
        if factor != 1.0:
            for i in range(first, first + self.state.particle_count):
                for field in ti.static(self.deviation):
                    for k in ti.static(range(self.state.dimensions)):
                        field[i][k] *= ti.cast(factor, float)
        return factor

    @ti.func
    def squared(self, replica):
        """|δ|² of a replica now."""
        first = replica * self.state.particle_count
        result = ti.cast(0.0, self.state.wide)
        for i in range(first, first + self.state.particle_count):
            for field in ti.static(self.deviation[:2]):
                for k in ti.static(range(self.state.dimensions)):
                    result += self.wide_square(field[i][k])
        return result

    @ti.func
    def measure_lanes(self, lanes: Template, block, dt):
        """The same for the copies of a block of a LaneState."""
        size = ti.static(self.state.particle_count * self.state.dimensions)
        first = block * size
        for lane in ti.static(range(lanes.lane_count)):
            replica = block * lanes.lane_count + lane
            if replica < self.state.replica_count:
                squared = ti.cast(0.0, self.state.wide)
                for i in range(self.state.particle_count):
                    for field in ti.static(self._of_lane(lanes, lane)[:2]):
                        for k in ti.static(range(self.state.dimensions)):
                            squared += self.wide_square(field[first + i * self.state.dimensions + k])
                factor = self.add(replica, dt, squared)
                if factor != 1.0:
                    for entry in range(first, first + size):
                        for field in ti.static(self._of_lane(lanes, lane)):
                            field[entry] *= ti.cast(factor, float)

    def _of_lane(self, lanes: Any, lane: int) -> list[Any]:
        """The fields of the deviation in one lane."""
        return [lanes.fields_of(PREFIX + name)[lane] for name in MOVED]

    @ti.func
    def wide_square(self, number):
        """The square in the widest float of the device."""
        wide = ti.cast(number, self.state.wide)
        return wide * wide

    @ti.func
    def add(self, replica, dt, squared):
        """Add a step after which |δ|² is `squared` to the sums; the power of two by which δ is to be multiplied."""
        factor = ti.cast(1.0, self.state.wide)
        growth = self.sums["shift"][replica] + 0.5 * self.logarithm(squared)
        if squared > 2.0 ** (2 * RANGE_BITS):
            factor = 2.0**-RANGE_BITS
            self.sums["shift"][replica] += ti.static(RANGE_BITS * float(np.log(2.0)))
        elif squared < 2.0 ** (-2 * RANGE_BITS) and squared > 0.0:
            factor = 2.0**RANGE_BITS
            self.sums["shift"][replica] -= ti.static(RANGE_BITS * float(np.log(2.0)))
        before, step = self.sums["growth"][replica], ti.cast(dt, self.state.wide)
        elapsed, integral = self.sums["elapsed"][replica], self.sums["growth_integral"][replica]
        earlier = ti.cast(0.0, self.state.wide)
        if elapsed > 0.0:
            earlier = 2.0 * (before - integral / elapsed)
        elapsed += step
        integral += 0.5 * step * (before + growth)
        later = 2.0 * (growth - integral / elapsed)
        self.sums["growth"][replica], self.sums["elapsed"][replica] = growth, elapsed
        self.sums["growth_integral"][replica] = integral
        self.sums["megno_integral"][replica] += 0.5 * step * (earlier + later)
        self.sums["largest_growth"][replica] = ti.max(self.sums["largest_growth"][replica], growth)
        return factor

    @ti.func
    def logarithm(self, squared):
        """The natural logarithm, in the widest float that has one."""
        result = ti.cast(0.0, self.state.wide)
        if ti.static(self.single_logarithm):
            result = ti.cast(ti.log(ti.cast(squared, ti.f32)), self.state.wide)
        else:
            result = ti.log(squared)
        return result
