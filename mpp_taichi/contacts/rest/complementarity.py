"""Impulses of many contacts at once: a projected gradient iteration with momentum, in one order for any number of threads."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts.rest.contact_rows import ContactRows

CHUNK = 256  # spheres whose terms one thread sums
PATIENCE = 2_000  # iterations after which the groups that are not solved are solved on the host
FEWEST = 4  # iterations at least, so that the impulses of lasting contacts improve from drift to drift
BATCH = 8  # iterations between two tests of the host


@ti.data_oriented
class Complementarity:
    """Find λ with 0 ≤ λ ⟂ n·(v_i − v_j) + offset + ε λ ≥ 0 for all active entries, v = v₀ + M⁻¹ Σ n λ.

    With ε = 0 the velocities are unique: in the metric of the kinetic energy they are the closest to v₀ at which no contact
    approaches faster than its offset allows. ε = compliance/h² [1 / mass] lets contacts yield, and bounds the condition number:
    some 10⁷ for 2,000 spheres in a packing without friction, 6/(ε m) where they yield.

    Entry c steps by s = 1/(μ_i + μ_j + ε), μ_i the largest yielding of sphere i to its contacts: as
    λᵀ N M⁻¹ Nᵀ λ ≤ Σ_i μ_i Σ_c λ_c² over the contacts c of i, no step leads uphill. Nesterov's momentum is dropped whenever it
    leads uphill (O'Donoghue & Candès, Found. Comput. Math. 15 (2015) 715). |λ' − λ| h / s is the distance [length] by which a
    contact is violated, or open under load, at the end of the drift. The iteration ends when this is at most `tolerance` of
    the smaller radius at every contact.
    """

    def __init__(self, rows: ContactRows, tolerance: float, wide: Any, compliance: float = 0.0):
        """Allocate for the spheres and entries of `rows`; `wide` is the type of sums."""
        self.rows = rows
        self.tolerance = tolerance
        self.compliance = compliance
        self.wide = wide
        n = rows.particle_count
        self.chunk_count = -(-n // CHUNK)
        builder = ti.FieldsBuilder()
        self.base, self.velocity, self.following, self.ahead = (ti.Vector.field(rows.dimensions, float) for _ in range(4))
        self.terms = ti.Vector.field(2, float)
        self.yielding = ti.field(float)
        for field in (self.base, self.velocity, self.following, self.ahead, self.terms, self.yielding):
            builder.dense(ti.i, n).place(field)
        self.offset, self.step, self.before = (ti.field(float) for _ in range(3))
        for field in (self.offset, self.step, self.before):
            builder.dense(ti.i, rows.capacity).place(field)
        self.momentum = ti.Vector.field(2, float)  # θ of Nesterov's sequence, and the share of the last change that is added
        self.softness = ti.field(float)  # ε [1 / mass]
        builder.dense(ti.i, 1).place(self.momentum, self.softness)
        self._trees = [builder.finalize()]
        builder = ti.FieldsBuilder()
        self.chunk_terms = ti.Vector.field(2, wide)
        builder.dense(ti.i, self.chunk_count).place(self.chunk_terms)
        self.total = ti.Vector.field(2, wide)
        builder.dense(ti.i, 1).place(self.total)
        self._trees.append(builder.finalize())

    def destroy(self) -> None:
        """Give the memory back."""
        for tree in self._trees:
            tree.destroy()

    @ti.func
    def prepare(self, impacts_only, h):
        """Set the steps of the active entries, 0 for the others, then the first velocities and the momentum.

        With `impacts_only` only impacts are active, and they have no compliance.
        """
        for _ in range(1):
            self.softness[0] = 0.0 if impacts_only == 1 else ti.cast(self.compliance, float) / (h * h)
        for i in range(self.rows.particle_count):
            self.yielding[i] = self._largest_yielding(i, impacts_only)
        for i in range(self.rows.particle_count):
            for c in range(self.rows.start[i], self.rows.start[i + 1]):
                width = ti.cast(0.0, float)
                if impacts_only == 0 or self.rows.impact[c] == 1:
                    width = self.yielding[i]
                    if self.rows.other[c] >= 0:
                        width += self.yielding[self.rows.other[c]]
                self.step[c] = 1.0 / (width + self.softness[0]) if width > 0.0 else 0.0
                self.before[c] = self.rows.impulse[c]
            self._add_impulses(i)
            self.velocity[i] = self.following[i]
            self.ahead[i] = self.following[i]
            if i == 0:
                self.momentum[0] = ti.Vector([1.0, 0.0])

    @ti.func
    def _largest_yielding(self, i, impacts_only):
        """A bound on the largest eigenvalue μ of T = M⁻½ Σ n nᵀ M⁻½ over the active entries of row i [1 / mass].

        (tr T⁸)^⅛ is μ for one contact, and at most 3^⅛ = 1.15 times as much for any number of them.
        """
        matrix = ti.Matrix.zero(float, self.rows.dimensions, self.rows.dimensions)
        for c in range(self.rows.start[i], self.rows.start[i + 1]):
            if impacts_only == 0 or self.rows.impact[c] == 1:
                n = ti.sqrt(self.rows.inverse_mass[i]) * self.rows.normal[c]
                matrix += n.outer_product(n)
        trace = matrix.trace()
        result = ti.cast(0.0, float)
        if trace > 0.0:
            power = matrix / trace
            for _ in ti.static(range(3)):
                power = power @ power
            result = trace * ti.sqrt(ti.sqrt(ti.sqrt(power.trace())))
        return result

    @ti.func
    def _add_impulses(self, i):
        """following = base + M⁻¹ Σ n λ."""
        change = ti.Vector.zero(float, self.rows.dimensions)
        for c in range(self.rows.start[i], self.rows.start[i + 1]):
            if self.step[c] > 0.0:
                change += self.rows.impulse[c] * self.rows.normal[c]
        self.following[i] = self.base[i] + self.rows.inverse_mass[i] * change

    @ti.func
    def iterate(self):
        """One iteration; total[0] becomes (positive if momentum led uphill, largest violation / radius [1 / time])."""
        for i in range(self.rows.particle_count):
            share = self.momentum[0][1]
            v = self.ahead[i]
            uphill = ti.cast(0.0, float)
            worst = ti.cast(0.0, float)
            change = ti.Vector.zero(float, self.rows.dimensions)
            for c in range(self.rows.start[i], self.rows.start[i + 1]):
                if self.step[c] > 0.0:
                    n = self.rows.normal[c]
                    u = n.dot(v - self.rows.velocity_of_other(self.ahead, c)) + self.offset[c]
                    old = self.rows.impulse[c]
                    ahead = old + share * (old - self.before[c])
                    if ti.static(self.compliance > 0.0):
                        u += self.softness[0] * ahead
                    new = ti.max(ahead - self.step[c] * u, 0.0)
                    uphill += (ahead - new) * (new - old) / self.step[c]
                    worst = ti.max(worst, ti.abs(new - ahead) / (self.step[c] * self.rows.smaller_radius(i, c)))
                    self.before[c] = old
                    self.rows.impulse[c] = new
                    change += new * n
            self.following[i] = self.base[i] + self.rows.inverse_mass[i] * change
            self.terms[i] = ti.Vector([uphill, worst])
        for k in range(self.chunk_count):
            uphill = ti.cast(0.0, self.wide)
            worst = ti.cast(0.0, self.wide)
            for i in range(k * CHUNK, ti.min((k + 1) * CHUNK, self.rows.particle_count)):
                uphill += ti.cast(self.terms[i][0], self.wide)
                worst = ti.max(worst, ti.cast(self.terms[i][1], self.wide))
            self.chunk_terms[k] = ti.Vector([uphill, worst])
        for _ in range(1):
            uphill = ti.cast(0.0, self.wide)
            worst = ti.cast(0.0, self.wide)
            for k in range(self.chunk_count):
                uphill += self.chunk_terms[k][0]
                worst = ti.max(worst, self.chunk_terms[k][1])
            self.total[0] = ti.Vector([uphill, worst])
            theta = self.momentum[0][0]
            later = (1.0 + ti.sqrt(1.0 + 4.0 * theta * theta)) / 2.0
            share = (theta - 1.0) / later
            if uphill > 0.0:
                later = ti.cast(1.0, float)
                share = ti.cast(0.0, float)
            self.momentum[0] = ti.Vector([later, share])
        for i in range(self.rows.particle_count):
            new = self.following[i]
            self.ahead[i] = new + self.momentum[0][1] * (new - self.velocity[i])
            self.velocity[i] = new

    @ti.func
    def reduce_largest(self):
        """total[0] becomes the largest of each of the two terms."""
        for k in range(self.chunk_count):
            largest = ti.Vector.zero(float, 2)
            for i in range(k * CHUNK, ti.min((k + 1) * CHUNK, self.rows.particle_count)):
                largest = ti.max(largest, self.terms[i])
            self.chunk_terms[k] = ti.cast(largest, self.wide)
        for _ in range(1):
            largest = ti.Vector.zero(self.wide, 2)
            for k in range(self.chunk_count):
                largest = ti.max(largest, self.chunk_terms[k])
            self.total[0] = largest

    @ti.func
    def solve_serial(self, h):
        """Iterate in one thread; returns the number of iterations, and 1 if they did not converge."""
        iterations = 0
        unsolved = 0
        going = 1
        while going == 1:
            self.iterate()
            iterations += 1
            solved = self.total[0][1] * h <= self.tolerance and iterations >= FEWEST
            unsolved = 0 if solved else 1
            if solved or iterations >= PATIENCE:
                going = 0
        return ti.Vector([iterations, unsolved])

    @ti.kernel
    def _iterate(self):
        self.iterate()

    def solve_parallel(self, h: float, iterations: int, most: int) -> tuple[int, bool]:
        """Iterate on, with a launch for each iteration, from `iterations` up to `most`.

        Returns the number of iterations, and whether they did not converge.
        """
        while iterations < most:
            for _ in range(BATCH):
                self._iterate()
            iterations += BATCH
            if float(self.total[0][1]) * h <= self.tolerance:
                return iterations, False
        return iterations, True
