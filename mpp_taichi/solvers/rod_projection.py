"""Rod projection: positions and velocities that keep the lengths of rigid rods, by SHAKE and RATTLE with a direct solver."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.particle_update import drift_particle
from mpp_taichi.device import bulk_copy
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.state.rod_band import rod_band
from mpp_taichi.types import Template

MOST_ROUNDS = 100
"""Rounds for one drift. The error shrinks by about the angle that rods turn in the drift: below half a radian, 60 suffice."""
ROUNDED = 64.0
"""Relative error of a length, in units of the last place of the coordinates, below which only rounding is left."""
ROUNDS_OF_VELOCITIES = 2
"""Rounds for velocities, whose equations are linear: the second takes the rounding of the first."""
SHRINKS = 0.5
"""Ratio of the errors of two rounds above which an error that is nearly rounding no longer shrinks."""
SMALLEST_PIVOT = 64.0
"""Ratio of pivot and diagonal, in units of the last place, below which other rods already fix the length of a rod."""
COUNTS = 3
"""Entries of `rod_counts` for each replica: drifts done, 1 + the first rod that failed, 1 where its pivot was 0."""


@ti.data_oriented
class RodProjection:
    """Rods |x_j − x_i| = L as constraints on drifts and kicks.

    A drift of the time h moves the particles by x + h v, then finds impulses μ along the directions that the rods had before:
    v ← v + M⁻¹ G₀ᵀ μ and x ← x + h M⁻¹ G₀ᵀ μ, until all lengths are L to round-off. Then velocities are projected on the
    directions G that the rods have now: G v = 0. A kick is projected in the same way. Each such drift is symplectic and
    symmetric, and so are the compositions of drifts and kicks that are symmetric without rods.

    An end may be on a given path x(t): it is put at the end of the drift before the impulses, and has the velocity x′ of the
    begin in the first part and of the end in the second, so that the drift stays symmetric. The work −J·x′ of the agent
    against the impulses J of rods on it is summed.

    The impulses of a round solve G₀ M⁻¹ G₀ᵀ μ = −c/h by LDLᵀ of a band in the order of `rod_band`, in O(n) for a chain of n
    rods. In each round the error shrinks by about the angle that rods turn in the drift. One thread does all, in a fixed order.
    Source: Ryckaert, Ciccotti & Berendsen, J. Comput. Phys. 23 (1977) 327 (SHAKE); Andersen, J. Comput. Phys. 52 (1983) 24
    (RATTLE); Leimkuhler & Reich, Simulating Hamiltonian Dynamics (2004), chapter 7; Reich, SIAM J. Numer. Anal. 33 (1996) 475.
    """

    needs = frozenset({"mass"})

    def __init__(self, snapshot: Snapshot, dimensions: int):
        """Order the rods."""
        self.band = rod_band(snapshot)
        self.particle_count, self.dimensions = snapshot.particle_count, dimensions
        self.rod_count, self.product_count = len(self.band.first), len(self.band.row)
        self.width = self.band.width
        self.stride = self.width + 1
        self.driven = len(snapshot.driven) > 0
        self.memory = ("rod_work",) if self.driven else ()

    # Host

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """The fields of the state: kind and count for each replica."""
        return {
            **{f"rod_{name}": ("index", self.rod_count) for name in ("first", "second")},
            **{f"rod_{name}": ("scalar", self.rod_count) for name in ("length", "impulse")},
            "rod_direction": ("vector", self.rod_count),
            "rod_band": ("scalar", self.rod_count * self.stride),
            **{f"rod_product_{name}": ("index", self.product_count) for name in ("row", "column", "particle")},
            "rod_product_sign": ("scalar", self.product_count),
            "rod_counts": ("index", COUNTS),
            **({"rod_work": ("wide", 1)} if self.driven else {}),
        }

    def fill(self, state: Any) -> None:
        """Write the rods to the fields of a state; every replica has the same rods."""
        for name in ("first", "second", "length"):
            self._write(state, f"rod_{name}", getattr(self.band, name))
        for name in ("row", "column", "particle", "sign"):
            self._write(state, f"rod_product_{name}", getattr(self.band, name))
        self.begin_launch(state)

    def _write(self, state: Any, name: str, values: np.ndarray) -> None:
        field = getattr(state, name)
        kind = np.int32 if values.dtype == np.int32 else np.float32 if field.dtype == ti.f32 else np.float64
        filled = np.zeros(field.shape[0], kind)
        filled[: len(values) * state.replica_count] = np.tile(values, state.replica_count)
        field.from_numpy(filled)

    def begin_launch(self, state: Any) -> None:
        """Count from 0 again."""
        bulk_copy.clear((state.rod_counts,))

    def failure(self, state: Any) -> tuple[int, int, bool] | None:
        """Replicas' fewest drifts since `begin_launch`, number of the rod that failed first, and whether its pivot was 0."""
        counts = state.rod_counts.to_numpy().reshape(-1, COUNTS)
        failed = counts[counts[:, 1] > 0]
        if not len(failed):
            return None
        worst = failed[int(np.argmin(failed[:, 0]))]
        return int(worst[0]), int(worst[1]) - 1, bool(worst[2])

    def work(self, state: Any) -> float:
        """Work that the agents that move ends of rods have done on the rods of the first replica since the start [energy]."""
        return float(state.rod_work[0]) if self.driven else 0.0

    def loop_iterations(self) -> int:
        """Loop iterations of one thread in one drift and one kick, roughly, with a usual number of rounds."""
        return 30 * (self.product_count + self.rod_count * self.stride * self.stride)

    # Device

    @ti.func
    def replica(self, first):
        """Number of the replica whose first particle is `first`."""
        return first // self.particle_count

    @ti.func
    def inverse_mass(self, state: Template, i):
        """1/m of a particle along each axis; 0 along an axis that is held."""
        inverse = ti.cast(0.0, float)
        if state.mass[i] > 0.0:
            inverse = 1.0 / state.mass[i]
        result = ti.Vector([inverse for _ in ti.static(range(self.dimensions))])
        if ti.static(state.has_fixed_axes):
            result *= state.free[i]
        return result

    @ti.func
    def ends(self, state: Template, first, r):
        """The two particles of rod r."""
        return first + state.rod_first[r], first + state.rod_second[r]

    @ti.func
    def drift(self, state: Template, total_force: Template, first, time, begin, end):
        """x += h v with all lengths kept, h the `time`, and velocities across the rods; one loop at top level of a kernel.

        Bodies on given paths are put where they are at the time `begin` + `end`, at which the drift ends.
        Nothing is done where h is 0. Before the motion and after it the same text runs, which halves the time of compilation.
        """
        for _ in range(1):
            if time != 0.0:
                for after in range(2):
                    self.factor(state, first)
                    if after == 0:
                        for i in range(first, first + self.particle_count):
                            drift_particle(state, i, time, 0)
                        if ti.static(self.driven):
                            total_force.paths.put(state, first, begin + end, True, False)
                    elif ti.static(self.driven):
                        total_force.paths.put(state, first, begin + end, False, True)
                    self.impulses(state, first, time, after)

    @ti.func
    def impulses(self, state: Template, first, time, after):
        """Impulses along the directions in the state: `after` the motion until G v = 0, before until all lengths are kept.

        Lengths are kept to round-off; where they cannot be, the failure is counted.
        """
        spacing = ti.static(2.0**-23 if state.position.dtype == ti.f32 else 2.0**-52)
        base, counts = self.replica(first) * self.rod_count, self.replica(first) * COUNTS
        before, rounds, goes_on = ti.cast(1e30, float), 0, 1
        while goes_on == 1:
            worst, where = ti.cast(0.0, float), 0
            for r in range(self.rod_count):
                if after == 1:
                    self.set_closing(state, first, r, state.velocity)
                else:
                    error = self.set_excess(state, first, r, time)
                    if error > worst or ti.math.isnan(error):
                        worst, where = ti.select(ti.math.isnan(error), 1e30, error), r
            if after == 1:
                goes_on = int(rounds < ROUNDS_OF_VELOCITIES)
            elif worst <= spacing or (worst <= ROUNDED * spacing and worst > SHRINKS * before):
                goes_on = 0
                if state.rod_counts[counts + 1] == 0:
                    state.rod_counts[counts] = state.rod_counts[counts] + 1
            elif rounds == MOST_ROUNDS or worst >= 1e30:
                goes_on = 0
                if state.rod_counts[counts + 1] == 0:
                    state.rod_counts[counts + 1] = 1 + where
            if goes_on == 1:
                self.solve(state, first)
                for r in range(self.rod_count):
                    i, j = self.ends(state, first, r)
                    push = state.rod_impulse[base + r] * state.rod_direction[base + r]
                    one, other = -self.inverse_mass(state, i) * push, self.inverse_mass(state, j) * push
                    if ti.static(self.driven):
                        self.book(state, first, i, j, push)
                    state.velocity[i] = state.velocity[i] + one
                    state.velocity[j] = state.velocity[j] + other
                    if after == 0:  # the velocity was so from the beginning of the drift
                        state.position[i] = state.position[i] + time * one
                        state.position[j] = state.position[j] + time * other
            before = worst
            rounds += 1

    @ti.func
    def project(self, state: Template, first, vectors: Template, weight):
        """Take from velocities, or from their changes, the part by which rods would become longer; one loop.

        Changes enter the velocities with a `weight`.
        """
        for _ in range(1):
            self.factor(state, first)
            base = self.replica(first) * self.rod_count
            for _round in range(ROUNDS_OF_VELOCITIES):
                for r in range(self.rod_count):
                    self.set_closing(state, first, r, vectors)
                self.solve(state, first)
                for r in range(self.rod_count):
                    i, j = self.ends(state, first, r)
                    push = state.rod_impulse[base + r] * state.rod_direction[base + r]
                    if ti.static(self.driven):
                        self.book(state, first, i, j, weight * push)
                    vectors[i] = vectors[i] - self.inverse_mass(state, i) * push
                    vectors[j] = vectors[j] + self.inverse_mass(state, j) * push

    @ti.func
    def book(self, state: Template, first, i, j, push):
        """Add the work of the agents that move i or j, on which a rod acts with the impulses −push and push."""
        at, done = self.replica(first), ti.cast(0.0, state.wide)
        for k in ti.static(range(self.dimensions)):
            held_i, held_j = 1.0 - state.free[i][k], 1.0 - state.free[j][k]
            rate = held_i * state.velocity[i][k] - held_j * state.velocity[j][k]
            done += ti.cast(push[k], state.wide) * ti.cast(rate, state.wide)
        state.rod_work[at] = state.rod_work[at] + done

    @ti.func
    def set_closing(self, state: Template, first, r, vectors: Template):
        """Right-hand side −G v of rod r."""
        i, j = self.ends(state, first, r)
        at = self.replica(first) * self.rod_count + r
        state.rod_impulse[at] = -(vectors[j] - vectors[i]).dot(state.rod_direction[at])

    @ti.func
    def set_excess(self, state: Template, first, r, time):
        """Right-hand side −c/h of rod r with c = (|d|² − L²)/2L, and |c| as a part of the size of its coordinates."""
        i, j = self.ends(state, first, r)
        d, length = state.position[j] - state.position[i], state.rod_length[r]
        excess = (d.dot(d) - length * length) / (2.0 * length)
        state.rod_impulse[self.replica(first) * self.rod_count + r] = -excess / time
        return ti.abs(excess) / (length + ti.abs(state.position[i]).max() + ti.abs(state.position[j]).max())

    @ti.func
    def factor(self, state: Template, first):
        """Directions of the rods now, and L D Lᵀ = G M⁻¹ Gᵀ in place; entry (a, b) is at a·stride + width − (a − b)."""
        base, band = self.replica(first) * self.rod_count, self.replica(first) * self.rod_count * self.stride
        for r in range(self.rod_count):
            i, j = self.ends(state, first, r)
            state.rod_direction[base + r] = (state.position[j] - state.position[i]) / state.rod_length[r]
        for k in range(band, band + self.rod_count * self.stride):
            state.rod_band[k] = 0.0
        for c in range(self.product_count):
            a, b = state.rod_product_row[c], state.rod_product_column[c]
            weight = self.inverse_mass(state, first + state.rod_product_particle[c]) * state.rod_direction[base + a]
            k = band + a * self.stride + self.width - (a - b)
            value = state.rod_product_sign[c] * weight.dot(state.rod_direction[base + b])
            state.rod_band[k] = state.rod_band[k] + value
        for a in range(self.rod_count):
            self.eliminate(state, first, band, a)

    @ti.func
    def eliminate(self, state: Template, first, band, a):
        """Row a of the factors."""
        spacing = ti.static(2.0**-23 if state.position.dtype == ti.f32 else 2.0**-52)
        row = band + a * self.stride + self.width - a
        begin = ti.max(0, a - self.width)
        for b in range(begin, a):
            other = band + b * self.stride + self.width - b
            value = state.rod_band[row + b]
            for c in range(begin, b):
                value -= state.rod_band[row + c] * state.rod_band[other + c]
            state.rod_band[row + b] = value
        # So far the row holds L D; now it becomes L.
        diagonal = state.rod_band[row + a]
        pivot = diagonal
        for b in range(begin, a):
            whole = state.rod_band[row + b]
            part = whole / state.rod_band[band + b * self.stride + self.width]
            pivot -= whole * part
            state.rod_band[row + b] = part
        if not pivot > SMALLEST_PIVOT * spacing * diagonal:
            pivot = ti.max(SMALLEST_PIVOT * spacing * diagonal, 1e-30)
            counts = self.replica(first) * COUNTS
            if state.rod_counts[counts + 1] == 0:
                state.rod_counts[counts + 1] = 1 + a
                state.rod_counts[counts + 2] = 1
        state.rod_band[row + a] = pivot

    @ti.func
    def solve(self, state: Template, first):
        """Solve for the impulses in place, forwards and backwards."""
        base, band = self.replica(first) * self.rod_count, self.replica(first) * self.rod_count * self.stride
        for a in range(self.rod_count):
            value = state.rod_impulse[base + a]
            for b in range(ti.max(0, a - self.width), a):
                value -= state.rod_band[band + a * self.stride + self.width - (a - b)] * state.rod_impulse[base + b]
            state.rod_impulse[base + a] = value
        for a in range(self.rod_count):
            pivot = state.rod_band[band + a * self.stride + self.width]
            state.rod_impulse[base + a] = state.rod_impulse[base + a] / pivot
        for back in range(self.rod_count):
            a = self.rod_count - 1 - back
            value = state.rod_impulse[base + a]
            for b in range(a + 1, ti.min(self.rod_count, a + self.width + 1)):
                value -= state.rod_band[band + b * self.stride + self.width - (b - a)] * state.rod_impulse[base + b]
            state.rod_impulse[base + a] = value
