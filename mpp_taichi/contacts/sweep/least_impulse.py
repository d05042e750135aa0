"""The impulses that end an approach: a linear complementarity problem, solved exactly."""

import taichi as ti

from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.sweep.contact_group import ContactGroup

MEMBERS = 512  # contacts of the largest problem that is solved; a larger one is given up and reported


@ti.data_oriented
class LeastImpulse:
    """Find λ with 0 ≤ λ ⟂ A λ − b ≥ 0, A = N M⁻¹ Nᵀ the coupling of some contacts and b their approaching speeds.

    The velocities v + M⁻¹ Nᵀ λ are the closest to v, measured by the kinetic energy of the difference, at which none of the
    contacts approaches. These velocities are unique, whatever the numbering, also where λ is not unique. The method is the one
    of Lawson & Hanson, Solving Least Squares Problems (1974) ch. 23, on the normal equations, each contact scaled to A_cc = 1.

    With `shift` 1 it solves (A + 1 1ᵀ) λ = 1 instead. The contacts are jammed, so that at no velocity all of them open, if the
    remainder 1 − Σ λ is zero (Gordan's alternative).
    """

    def __init__(self, group: ContactGroup):
        """Allocate for up to MEMBERS of the contacts of `group`."""
        self.group = group
        self.capacity = min(group.capacity, MEMBERS)
        self._trees = FieldTrees()
        self.member, self.flag, self.passive = (ti.field(ti.i32) for _ in range(3))
        self.size, self.right, self.impulse, self.trial = (ti.field(float) for _ in range(4))
        for row in (self.member, self.flag, self.passive):
            self._trees.place(self.capacity, integers=[row])
        for row in (self.size, self.right, self.impulse, self.trial):
            self._trees.place(self.capacity, row)
        self.factor = ti.field(float)
        self._trees.place(self.capacity * self.capacity, self.factor)
        self._trees.finish()

    def destroy(self) -> None:
        """Give the memory back."""
        self._trees.destroy()

    @ti.func
    def solve(self, count, shift):
        """Solve for member[0 … count), whose scaled approaching speeds are in `right`; returns 1 if it did not converge.

        `size` holds √A_cc of each member, and `impulse` becomes λ_c √A_cc.
        """
        largest_right = ti.cast(0.0, float)
        largest_impulse = ti.cast(0.0, float)
        for p in range(count):
            self.flag[p] = 0  # 0: λ = 0, 1: λ > 0, 2: linearly dependent on the members with λ > 0
            self.impulse[p] = 0.0
            largest_right = ti.max(largest_right, self.right[p])
        rank = 0
        rounds = 0
        searching = 1
        while searching == 1:
            entering = -1
            largest = self.group.threshold * (largest_right + largest_impulse)
            for p in range(count):
                if self.flag[p] == 0:
                    left = self.right[p]
                    for r in range(rank):
                        q = self.passive[r]
                        left -= self._entry(p, q, shift) * self.impulse[q]
                    if left > largest:
                        largest = left
                        entering = p
            if entering < 0 or rounds > 10 * count + 50:
                searching = 0
            else:
                self.flag[entering] = 1
                self.passive[rank] = entering
                rank += 1
                start = rank - 1
                solving = 1
                while solving == 1:
                    rounds += 1
                    independent = self._factor_rows(start, rank, shift)
                    if independent == 0 and start == rank - 1:
                        self.flag[entering] = 2
                        rank -= 1
                        solving = 0
                    else:
                        self._solve_factored(rank)
                        step = self._step(rank)
                        kept = 0
                        start = rank
                        for r in range(rank):
                            q = self.passive[r]
                            leaves = self.trial[r] <= 0.0 and self._ratio(q, r) <= step
                            self.impulse[q] = self.impulse[q] + step * (self.trial[r] - self.impulse[q])
                            if leaves:
                                self.impulse[q] = 0.0
                                self.flag[q] = 2 if step == 0.0 and q == entering else 0
                                start = ti.min(start, r)
                            else:
                                self.passive[kept] = q
                                kept += 1
                        solving = 1 if kept < rank else 0
                        rank = kept
                        if step > 0.0:
                            for p in range(count):
                                if self.flag[p] == 2:
                                    self.flag[p] = 0
                        if rank == 0:
                            solving = 0
                largest_impulse = 0.0
                for r in range(rank):
                    largest_impulse = ti.max(largest_impulse, self.impulse[self.passive[r]])
        return 1 if rounds > 10 * count + 50 else 0

    @ti.func
    def _entry(self, p, q, shift):
        """Entry (p, q) of the scaled and shifted matrix."""
        return self.group.coupling(self.member[p], self.member[q]) / (self.size[p] * self.size[q]) + shift

    @ti.func
    def _factor_rows(self, start, rank, shift):
        """Rows start … rank − 1 of the Cholesky factor of the passive members; 0 if the last member depends on the others."""
        independent = 1
        for r in range(start, rank):
            p = self.passive[r]
            diagonal = 1.0 + shift
            for s in range(r):
                value = self._entry(p, self.passive[s], shift)
                for t in range(s):
                    value -= self.factor[r * self.capacity + t] * self.factor[s * self.capacity + t]
                value /= self.factor[s * self.capacity + s]
                self.factor[r * self.capacity + s] = value
                diagonal -= value * value
            independent = 1 if diagonal > self.group.threshold else 0
            self.factor[r * self.capacity + r] = ti.sqrt(ti.max(diagonal, self.group.threshold))
        return independent

    @ti.func
    def _solve_factored(self, rank):
        """`trial` becomes the solution for the passive members."""
        for r in range(rank):
            value = self.right[self.passive[r]]
            for s in range(r):
                value -= self.factor[r * self.capacity + s] * self.trial[s]
            self.trial[r] = value / self.factor[r * self.capacity + r]
        for back in range(rank):
            r = rank - 1 - back
            value = self.trial[r]
            for s in range(r + 1, rank):
                value -= self.factor[s * self.capacity + r] * self.trial[s]
            self.trial[r] = value / self.factor[r * self.capacity + r]

    @ti.func
    def _step(self, rank):
        """Share of the way from `impulse` to `trial` after which the first impulse would become negative, 0 … 1."""
        step = ti.cast(1.0, float)
        for r in range(rank):
            if self.trial[r] <= 0.0:
                step = ti.min(step, self._ratio(self.passive[r], r))
        return step

    @ti.func
    def _ratio(self, q, r):
        """Share of the way from `impulse` to a `trial` ≤ 0 at which the impulse of member q is zero, 0 … 1."""
        way = self.impulse[q] - self.trial[r]
        return self.impulse[q] / way if way > 0.0 else 0.0
