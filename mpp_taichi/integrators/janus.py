"""JANUS: leapfrogs on a lattice of integers, which run backwards to the very bit."""

import math
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.errors import SceneError
from mpp_taichi.integrators._base import Integrator
from mpp_taichi.integrators._launchers import Launchers
from mpp_taichi.integrators._trouble import Trouble, not_finite
from mpp_taichi.integrators.kahan_li6 import KahanLi6
from mpp_taichi.integrators.leapfrog import Leapfrog
from mpp_taichi.integrators.pefrl import Pefrl
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template
from mpp_taichi.wording.told_apart import told_apart

TABLES = {2: Leapfrog, 4: Pefrl, 6: KahanLi6}
"""Methods that begin and end with a drift and read the same backwards, by their order."""
BITS = 53  # of the largest coordinate at the start, as in f64; the other ten bits of an integer leave room to fly apart
SLOWEST = 1 / 128  # of the largest coordinate per dt: the least speed for which the lattice of velocities is made
LIMIT = 2.0**62
"""End of the lattice, in spacings."""
LEFT, NOT_A_NUMBER = 1, 2


@component
class Janus(Integrator):
    """Drifts n += ⟦c h v⟧ and kicks m += ⟦d h a(n)⟧ of integers n, m, x = n Δx, v = m Δv; ⟦ ⟧ is the nearest integer.

    Each drift or kick is undone by the same drift or kick with −h, since ⟦−y⟧ = −⟦y⟧, and so is a step, whose table reads the
    same backwards: a run with dt → −dt comes back to the bits with which it began, through any chaos. Rounding is a one-to-one
    map of the lattice onto itself, so the energy error is the error of the table: `leapfrog`, `pefrl` or `kahan_li6`. The start
    is put on the lattice. Δx is 2⁻⁵³ X, X the largest |coordinate| of the start, and Δv = 2⁻⁵³ V, V the largest |velocity|, but
    at least X / (128 dt), both rounded up to a power of two: a particle may go some 500 times as far and as fast before it
    leaves the lattice, which ends the run. The parameter `lattice` changes both spacings by the same factor. Integers of 64
    bits, on the CPU. Forces that depend on velocity or on time are refused.
    Source: Levesque & Verlet, J. Stat. Phys. 72 (1993) 519; Rein & Tamayo, MNRAS 473 (2018) 3351, arXiv:1704.07715.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order: int = param(2, choices=(2, 4, 6), help="order of the method: leapfrog, pefrl or kahan_li6")
    lattice: float = param(
        None, optional=True, above=0.0, unit="length", help="spacing Δx; absent: computed from the start, see above"
    )

    symplectic = True
    time_reversible = True
    takes_velocity = False
    takes_time = False
    launchers = Launchers(cpu_only=True)  # integers of 64 bits
    memory = ("lattice_position", "lattice_velocity", "left", "spacing")

    @property
    def entries(self) -> tuple:
        """(node, kick, drift) of each stage, of the splitting of this order."""
        return self.table.entries

    @property
    def table(self) -> Any:
        """The splitting of this order; only its coefficients are used, and no step of its own."""
        return TABLES[self.order](dt=1.0)

    @property
    def nodes(self) -> tuple:
        """The nodes of the table."""
        return self.table.nodes

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """The amplification of the table; ValueError with damping, which the method does not take."""
        if damping != 0.0:
            raise ValueError("janus takes no forces that depend on velocity")
        return self.table.amplification(frequency)

    def scratch_count(self, velocity_dependent: bool) -> int:
        """None: its fields are work fields with names."""
        return 0

    def loops(self, k: int, total_force: Any) -> int:
        """Every stage is one loop."""
        return 1

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """The integers, the spacings of both lattices in f64 whatever the precision, and which particles have left."""
        self._reach = float(np.abs(start.position).max())
        self._speed = float(np.abs(start.velocity).max())
        count = start.particle_count
        lattices = {name: ("lattice", count) for name in ("lattice_position", "lattice_velocity")}
        return {**lattices, "spacing": ("wide", 2), "left": ("index", count)}

    def _spacings(self, dt: float) -> tuple[float, float]:
        """Δx [length] and Δv [length / time] for the start of the phase and steps of dt, forwards or backwards."""
        reach = _power_of_two(max(self._reach, self._speed * abs(dt)) or 1.0)
        speed = _power_of_two(max(self._speed, SLOWEST * reach / abs(dt)))
        spacing = self.lattice or reach * 2.0**-BITS
        return spacing, spacing * (speed / reach)

    def adopt(self, state: Any, dt: float) -> None:
        """Put positions and velocities on the lattice, which stays the same until they are set again.

        Raises:
            SceneError: they lie beyond its end, or all velocities below its spacing.
        """
        self.spacings = self._spacings(dt)
        state.spacing.from_numpy(np.tile(self.spacings, state.replica_count))
        state.left.fill(0)
        for name, spacing in zip(("position", "velocity"), self.spacings):
            field = getattr(state, name)
            values = field.to_numpy()
            numbers = np.rint(values.astype(np.float64) / spacing)
            if not np.abs(numbers).max() < LIMIT:
                end, here = told_apart(LIMIT * spacing, np.abs(numbers).max() * spacing)
                raise SceneError(
                    f"integrator.janus: its lattice ends at a {name} of {end}, and the scene has a {name} of {here}; "
                    f"give it a larger `lattice` than {self.spacings[0]:.6g}"
                )
            if name == "velocity" and values.any() and not numbers.any():
                apart, largest = told_apart(spacing, np.abs(values).max())
                raise SceneError(
                    f"integrator.janus: its velocities are {apart} apart, and the largest of the scene is "
                    f"{largest}, which would be 0; take a longer dt than {dt:.6g}, or a smaller `lattice`"
                )
            getattr(state, f"lattice_{name}").from_numpy(numbers.astype(np.int64))
            held = state.free.to_numpy() == 0.0 if state.has_fixed_axes else False
            field.from_numpy(np.where(held, values, (numbers * spacing).astype(values.dtype)))

    def trouble(self, state: Any, bad: int) -> Trouble | None:
        """A particle that has left the lattice; its position is not finite then."""
        if bad < 0 or state.left[bad] != LEFT:
            return not_finite(bad)
        farthest, fastest = (LIMIT * state.spacing[k] for k in range(2))
        reason = (
            f"leaves the lattice of janus, which ends at a coordinate of {farthest:.6g} and a velocity of {fastest:.6g}; "
            f"try a smaller dt, or a larger `lattice` than {state.spacing[0]:.6g}"
        )
        return Trouble("off_lattice", bad, reason=reason)

    @ti.func
    def stage(self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template):
        """A kick and the drift after it; the first stage has no kick."""
        _node, kick, drift = ti.static(self.entries[k])
        self.kick_and_drift(state, total_force, first, kick * dt, drift * dt, k > 0 and total_force.has_velocity_independent)

    @ti.func
    def stage_after_force(self, state: Template, total_force: Template, first, time: Template, dt: Template, k):
        """A stage whose coefficients are looked up while the kernel runs, so that all stages share one copy of the code."""
        kick, drift = 0.0, 0.0
        for c in ti.static(range(1, self.evaluations + 1)):
            if k == c:
                kick, drift = self.entries[c][1], self.entries[c][2]
        self.kick_and_drift(state, total_force, first, kick * dt, drift * dt, total_force.has_velocity_independent)

    @ti.func
    def kick_and_drift(self, state: Template, total_force: Template, first, kick_time, drift_time, kicks: Template):
        """Kick and drift on the lattice, and set position and velocity from it.

        Without `kicks` the acceleration is not read: no sum has set it, it may be NaN, and NaN times zero is NaN.
        """
        r = first // total_force.particle_count
        position_spacing, velocity_spacing = state.spacing[2 * r], state.spacing[2 * r + 1]
        kick = ti.cast(kick_time, state.wide) / velocity_spacing
        drift = ti.cast(drift_time, state.wide) * (velocity_spacing / position_spacing)
        for i in range(first, first + total_force.particle_count):
            for axis in ti.static(range(state.dimensions)):
                speed, place = state.lattice_velocity[i][axis], state.lattice_position[i][axis]
                if ti.static(kicks):
                    speed = self.moved(state, i, speed, kick * ti.cast(state.acceleration[i][axis], state.wide))
                place = self.moved(state, i, place, drift * ti.cast(speed, state.wide))
                if self.is_free(state, i, axis):
                    state.lattice_velocity[i][axis], state.lattice_position[i][axis] = speed, place
                    state.velocity[i][axis] = ti.cast(ti.cast(speed, state.wide) * velocity_spacing, float)
                    state.position[i][axis] = ti.cast(ti.cast(place, state.wide) * position_spacing, float)
            if state.left[i] != 0:
                for axis in ti.static(range(state.dimensions)):
                    state.position[i][axis] = ti.math.nan  # every run is checked for NaN

    @ti.func
    def moved(self, state: Template, i, number, change):
        """`number` plus the integer nearest to `change`; where the sum is beyond the lattice, `number`, and `left` is set."""
        change = ti.round(change)
        result = number
        if ti.abs(ti.cast(number, state.wide) + change) < LIMIT:
            result = number + ti.cast(change, ti.i64)
        elif state.left[i] == 0:
            state.left[i] = ti.select(ti.math.isnan(change) or ti.math.isinf(change), NOT_A_NUMBER, LEFT)
        return result

    @ti.func
    def is_free(self, state: Template, i, axis: Template):
        """Whether particle i may move along an axis; a held particle keeps its place exactly, on the lattice or not."""
        result = True
        if ti.static(state.has_fixed_axes):
            result = state.free[i][axis] != 0.0
        return result


def _power_of_two(number: float) -> float:
    """The smallest power of two that is not less than a number."""
    return float(2.0 ** math.ceil(math.log2(number)))
