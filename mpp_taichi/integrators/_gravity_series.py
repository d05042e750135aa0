"""Power series of a motion under gravity: the recurrences of Taylor's method, several pairs side by side."""

import itertools
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import softened_square
from mpp_taichi.integrators._adaptive import smallest
from mpp_taichi.integrators._leverage import leverage_squared, strength
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template

FEW_PAIRS = 4  # up to so many pairs lie in one block of four lanes; more pairs lie in blocks of eight
EXPONENT = -1.5  # of the squared distance
LARGEST_SHARE = 8  # pairs of a particle that are summed without a loop
STEEPEST = 2.0**-12  # of the square of a term: the least square of the term two orders before, where that one vanishes
LEVERAGE = 0.75  # part of a pair's leverage that counts: in an encounter errors of steps differ in sign
FEW_ORDERS = 6  # orders whose coefficients are so large that the rounding of a constant factor would show


@ti.data_oriented
class GravitySeries:
    """Coefficients of the positions, x(t + θ u) = Σ X_n θ^n, u the unit of time, from X_0 = x and X_1 = u v.

    For each pair d = x_j − x_i, q = d·d + ε², s = q^(−3/2); Cauchy's products give

        Q_n = Σ_k D_k·D_(n−k),  n Q_0 S_n = Σ_(k<n) (−3/2 (n − k) − k) Q_(n−k) S_k,  A_n = Σ_j G m_j Σ_k S_k D_(n−k),
        X_(n+2) = u² A_n / ((n + 1)(n + 2))

    A pair is computed once and acts on both particles. Pairs lie in blocks of lanes, one pair in each lane. In memory the lanes
    of one quantity (D, Q or S) of a block are next to each other; then come the next quantity, the next block and the next
    order. A sum over k therefore reads whole vectors, for which the kernel is compiled with `explicit_vectors`. Unused lanes
    repeat the first pair and act on no particle.
    Sources: Moore, Interval Analysis (1966) ch. 11; Jorba & Zou, Exp. Math. 14 (2005) 99.
    """

    def __init__(self, total_force: Any, start: Snapshot, order: int) -> None:
        """Lay out the blocks for the pairs of `start`, and coefficients up to `order`."""
        self.total_force = total_force
        self.count, self.dimensions = start.particle_count, total_force.dimensions
        self.rows = order + 1  # of coefficients
        self.least = smallest()  # keeps 0/0 away
        pairs = self.count * (self.count - 1) // 2 if total_force.has_pairs else 0
        self.pair_count = pairs
        self.share = min(self.count - 1, LARGEST_SHARE) if pairs else 0
        self.shares = -(-(self.count - 1) // self.share) if pairs else 0
        self.lanes = 4 if pairs <= FEW_PAIRS else 8
        self.blocks = -(-pairs // self.lanes)
        self.slots = self.blocks * self.lanes  # for pairs
        self.quantities = self.dimensions + 2  # D, Q (of order 0: 1/Q) and S
        self.group = self.count if self.blocks == 1 else 1  # of particles whose series are summed side by side
        self.row_size = self.blocks * self.quantities
        # Where all pairs fit into one block they are known when kernels are compiled; otherwise they are looked up in a field.
        self.pairs = list(itertools.combinations(range(self.count), 2)) if self.blocks == 1 else []
        self.pairs += [(0, 1)] * (self.lanes - len(self.pairs))
        self.softening_squared = float(total_force.pair_forces[0].softening) ** 2 if pairs else 0.0

    def iterations(self) -> int:
        """Loop iterations of `extend` and `last_terms`, an upper bound."""
        of_an_order = 2 + self.blocks * (1 + self.rows) + self.count * (1 + self.shares)
        return self.rows * of_an_order + 2 * self.blocks

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """The coefficients, and for each pair the indices and joint strength of its particles, its force and its series."""
        return {
            "coefficient": ("vector", self.rows * self.count),
            "pair_end": ("index", 2 * self.slots),
            "pair_strength": ("scalar", self.slots),
            "pair_series": (f"vector{self.lanes}", (self.rows - 2) * self.row_size),
            "pair_force": ("scalar", self.blocks * self.dimensions * self.lanes),
            "own_pair": ("index", self.share * self.shares * self.count),
            "own_pull": ("scalar", self.share * self.shares * self.count),
        }

    @staticmethod
    def component(state: Any, c: int) -> Any:
        """One axis of the coefficients, as a field of numbers: with explicit vectors Taichi cannot store part of a vector."""
        return state.coefficient.get_scalar_field(c)

    def slot_of(self, i: int, j: int) -> int:
        """Slot of the pair of particle i and the j-th other particle."""
        other = j if j < i else j + 1
        return self.pairs.index((min(i, other), max(i, other)))

    @ti.func
    def begin(self, state: Template, first):
        """Write the table of pairs: the particles of each slot, and the slots of each particle."""
        if ti.static(self.pair_count > 0):
            slot = 0
            for i in range(self.count):
                for j in range(i + 1, self.count):
                    self._set_end(state, first, slot, i, j)
                    self._set_own(state, first, slot, i, j, j - 1, 1.0)
                    self._set_own(state, first, slot, j, i, i, -1.0)
                    slot += 1
            while slot < self.slots:
                self._set_end(state, first, slot, 0, 1)
                slot += 1

    @ti.func
    def _set_end(self, state: Template, first, slot, i, j):
        """Make `slot` the pair with d = x_j − x_i."""
        place = first // self.count * self.slots + slot
        state.pair_end[2 * place] = i
        state.pair_end[2 * place + 1] = j
        for force in ti.static(self.total_force.pair_forces):
            state.pair_strength[place] = strength(state, force, first + i, first + j)

    @ti.func
    def _set_own(self, state: Template, first, slot, i, j, place, sign):
        """Make `slot` the pair of particle i at this place of its list, with the strength by which particle j attracts i."""
        own = (first + i) * self.shares * self.share + place
        block, lane = slot // self.lanes, slot % self.lanes
        state.own_pair[own] = (first // self.count * self.blocks + block) * self.dimensions * self.lanes + lane
        for force in ti.static(self.total_force.pair_forces):
            state.own_pull[own] = sign * force.response(state, first + i) * force.source(state, first + j)

    @ti.func
    def extend(self, state: Template, first, unit, time):
        """Compute the coefficients from 2 on, from the coefficients 0 and 1."""
        r = first // self.count
        for n in range(self.rows - 2):
            if ti.static(self.blocks == 1):
                self._extend_few(state, first, r, n, unit, time)
            else:
                if ti.static(self.blocks > 1):
                    self._pull_all(state, r, n)
                for i in range(first, first + self.count):
                    a = self._external(state, i, n, time)
                    for part in range(self.shares):
                        for member in ti.static(range(self.share)):
                            own = (i * self.shares + part) * self.share + member
                            for c in ti.static(range(self.dimensions)):
                                a[c] += state.own_pull[own] * state.pair_force[state.own_pair[own] + c * self.lanes]
                    self._place(state, first, r, i, n, unit, a)

    @ti.func
    def _pull_all(self, state: Template, r, n):
        for block in range(self.blocks):
            pull = self._pull(state, r, n, block)
            for c, lane in ti.static(ti.ndrange(self.dimensions, self.lanes)):
                state.pair_force[((r * self.blocks + block) * self.dimensions + c) * self.lanes + lane] = pull[c][lane]

    @ti.func
    def _extend_few(self, state: Template, first, r, n, unit, time):
        """`extend` by one order where all pairs fit into one vector: no pair is looked up."""
        pull = self._pull(state, r, n, 0)
        for i in ti.static(range(self.count)):
            a = self._external(state, first + i, n, time)
            for j in ti.static(range(self.count - 1)):
                for c in ti.static(range(self.dimensions)):
                    a[c] += state.own_pull[(first + i) * self.share + j] * pull[c][ti.static(self.slot_of(i, j))]
            self._place(state, first, r, first + i, n, unit, a)

    @ti.func
    def _external(self, state: Template, i, n, time):
        """Acceleration by external forces, which are constant and contribute only to order 0."""
        a = [0.0 for c in ti.static(range(self.dimensions))]
        if n == 0:
            for force in ti.static(self.total_force.external):
                g = force.accelerate(state, i, ti.Vector.zero(float, self.dimensions), time)
                for c in ti.static(range(self.dimensions)):
                    a[c] += g[c]
        return a

    @ti.func
    def _place(self, state: Template, first, r, i, n, unit, a):
        """Store coefficient n + 2 of particle i."""
        row = (r * self.rows + n + 2) * self.count + i - first
        for c in ti.static(range(self.dimensions)):
            x = self._divided(a[c] * (unit * unit), n, (n + 1) * (n + 2))
            if ti.static(state.has_fixed_axes):
                x = x if state.free[i][c] != 0.0 else 0.0
            ti.static(self.component(state, c))[row] = x

    @ti.func
    def _divided(self, x, n, divisor):
        """x / divisor. A product with 1/divisor is faster, but the rounding of the factor is the same in every step.

        In the low orders, whose coefficients are large, that would show as a drift of the energy.
        """
        result = x
        if n < FEW_ORDERS:
            result = x / divisor
        else:
            result = x * (1.0 / divisor)
        return result

    @ti.func
    def _pull(self, state: Template, r, n, block):
        """Order n of the pairs of a block: extend their series, and return their part of the accelerations."""
        lanes, axes = ti.static(self.lanes, self.dimensions)
        origin = (r * (self.rows - 2) * self.blocks + block) * self.quantities
        now = origin + n * self.row_size
        d = self._separation(state, r, n, block)
        for c in ti.static(range(axes)):
            self._store(state, now + c, d[c])
        pull = [ti.Vector.zero(float, lanes) for c in ti.static(range(axes))]
        if n == 0:
            squared = d[0] * d[0]
            for c in ti.static(range(1, axes)):
                squared = squared + d[c] * d[c]
            inverse = 1.0 / softened_square(squared, self.softening_squared)
            s = inverse * ti.sqrt(inverse)
            self._store(state, now + axes, inverse)
            self._store(state, now + axes + 1, s)
            for c in ti.static(range(axes)):
                pull[c] = s * d[c]
        else:
            q_terms = [ti.Vector.zero(float, lanes) for c in ti.static(range(axes))]
            s_sum = ti.Vector.zero(float, lanes)
            weight = EXPONENT * n  # of order k: −3/2 (n − k) − k
            for k in range(1, n):
                weight -= EXPONENT + 1.0
                here, back = origin + k * self.row_size, origin + (n - k) * self.row_size
                s = self._load(state, here + axes + 1)
                s_sum = s_sum + (weight * s) * self._load(state, back + axes)
                for c in ti.static(range(axes)):
                    other = self._load(state, back + c)
                    pull[c] = pull[c] + s * other
                    q_terms[c] = q_terms[c] + other * self._load(state, here + c)
            # The terms with order 0, and of order n.
            q_sum = q_terms[0]
            zeroth = d[0] * self._load(state, origin)
            for c in ti.static(range(1, axes)):
                q_sum = q_sum + q_terms[c]
                zeroth = zeroth + d[c] * self._load(state, origin + c)
            q = q_sum + 2.0 * zeroth
            s0 = self._load(state, origin + axes + 1)
            s = self._divided((s_sum + (EXPONENT * n) * (q * s0)) * self._load(state, origin + axes), n, n)
            self._store(state, now + axes, q)
            self._store(state, now + axes + 1, s)
            for c in ti.static(range(axes)):
                pull[c] = (pull[c] + s0 * d[c]) + s * self._load(state, origin + c)
        return pull

    @ti.func
    def last_terms(self, state: Template, first, unit, judged):
        """Squares of the largest last terms of all pairs; infinite where one is NaN.

        They are |D_(p−1)|²/Q_0, |D_p|²/Q_0, and, where `judged` is above 0, the square of the error of a step of one unit
        of time.
        """
        r = first // self.count
        last = ti.static(self.rows - 1)
        result = ti.Vector([0.0, 0.0, 0.0])
        if ti.static(self.pair_count > 0):
            total = 0.0
            for block in range(self.blocks):
                origin = (r * (self.rows - 2) * self.blocks + block) * self.quantities
                inverse = self._load(state, origin + ti.static(self.dimensions))
                before = self._norm_squared(state, r, last - 1, block) * inverse
                end = self._norm_squared(state, r, last, block) * inverse
                for lane in ti.static(range(self.lanes)):
                    result[0], result[1] = ti.max(result[0], before[lane]), ti.max(result[1], end[lane])
                    total += before[lane] + end[lane]
                if judged > 0.0:
                    error = self._error_squared(state, r, block, unit, inverse, before, end)
                    for lane in ti.static(range(self.lanes)):
                        result[2] = ti.max(result[2], error[lane])
                        total += error[lane]
            if not total < ti.math.inf:
                result = ti.Vector([ti.math.inf, ti.math.inf, ti.math.inf])
        return result

    @ti.func
    def _error_squared(self, state: Template, r, block, unit, inverse, before, end):
        """The square of (p + 1) |D_(p+1)| (1 + (0.75 L)²)^½ / w of a block: the error of a step, L the leverage of a pair.

        (p + 1) D_(p+1) is the first term that the velocity lacks. w² = |D_1|² + 2 g + Q_0/T² is the square of the pair's
        speed, g the depth of its potential and T the time in which terms fall, T⁻⁴ the larger of |D_p|²/|D_(p−2)|² and
        |D_(p−1)|²/|D_(p−3)|². The last terms are continued by |D_(p+1)| = max(|D_p|/T, |D_(p−1)|/T²). All is in units of √Q_0
        and of the unit of time.
        """
        last = ti.static(self.rows - 1)
        place = r * self.slots + block * self.lanes
        strong = ti.Vector([state.pair_strength[place + lane] for lane in ti.static(range(self.lanes))])
        depth = strong * (unit * unit) * inverse * ti.sqrt(inverse)
        speed = self._norm_squared(state, r, 1, block) * inverse
        d, bend = self._separation(state, r, 0, block), self._separation(state, r, 2, block)
        tide = depth * 0.0
        for c in ti.static(range(self.dimensions)):
            part = 2.0 * bend[c] + depth * d[c]
            tide = tide + part * part * inverse
        two_before = self._norm_squared(state, r, last - 2, block) * inverse
        three_before = self._norm_squared(state, r, last - 3, block) * inverse
        fall = ti.max(
            end / (two_before + STEEPEST * end + self.least), before / (three_before + STEEPEST * before + self.least)
        )
        root = ti.sqrt(fall)
        lacking = (1.0 * (last + 1) ** 2) * ti.max(end * root, before * fall)
        scale = speed + 2.0 * ti.sqrt(depth * depth) + root + self.least
        return lacking * (1.0 + LEVERAGE**2 * leverage_squared(speed, depth, tide)) / scale

    @ti.func
    def _norm_squared(self, state: Template, r, n, block):
        """|D_n|² of a block."""
        d = self._separation(state, r, n, block)
        result = d[0] * d[0]
        for c in ti.static(range(1, self.dimensions)):
            result = result + d[c] * d[c]
        return result

    @ti.func
    def _separation(self, state: Template, r, n, block):
        """D_n of a block: a vector of lanes for each axis."""
        row = (r * self.rows + n) * self.count
        p = 2 * (r * self.slots + block * self.lanes)
        begin = [
            row + (self.pairs[lane][0] if ti.static(self.blocks == 1) else state.pair_end[p + 2 * lane])
            for lane in ti.static(range(self.lanes))
        ]
        end = [
            row + (self.pairs[lane][1] if ti.static(self.blocks == 1) else state.pair_end[p + 2 * lane + 1])
            for lane in ti.static(range(self.lanes))
        ]
        return [
            ti.Vector(
                [
                    ti.static(self.component(state, c))[end[lane]] - ti.static(self.component(state, c))[begin[lane]]
                    for lane in ti.static(range(self.lanes))
                ]
            )
            for c in ti.static(range(self.dimensions))
        ]

    @ti.func
    def _load(self, state: Template, place):
        return ti.Vector([ti.static(state.pair_series.get_scalar_field(lane))[place] for lane in ti.static(range(self.lanes))])

    @ti.func
    def _store(self, state: Template, place, values):
        for lane in ti.static(range(self.lanes)):
            ti.static(state.pair_series.get_scalar_field(lane))[place] = values[lane]
