"""Counts of a solver: for each sphere while a drift is tried, and in sums of a fixed order when the drift is kept."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.error_free import two_sum
from mpp_taichi.contacts._base import ContactReport
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu
from mpp_taichi.types import Template

CHUNKS = 64  # of spheres; a fixed number, so that sums do not depend on the threads
STRIPES = 1024  # threads that add up the totals, where each sphere has totals of its own
PAIRS, WALLS, ELASTIC, FAILED, GIVEN_UP = 0, 1, 2, 3, 4
VIRIAL, LOST, WORK = 0, 1, 2


@ti.data_oriented
class Tally:
    """counted (pairs, walls, elastic, given up), summed (virial, dissipated energy), pushed (impulse on walls) per sphere.

    Where walls move, `summed` has the work of the walls as a third number.
    There are totals for each of CHUNKS of spheres. On a device of many threads they are `apart`: each sphere has totals of its
    own, so that no two threads write to one place, and STRIPES threads add them up before the host reads them. The sums of
    real numbers grow through a phase (`sum_fields`), and a report has their growth, so that a run may be collected at any
    steps with the same bits at its end.
    """

    def __init__(
        self,
        particle_count: int,
        account_count: int,
        wide: Any,
        *,
        apart: bool | None = None,
        placed_by_caller: bool = False,
        works: bool = False,
    ) -> None:
        """Allocate; `wide` is the type of the sums; `apart` when absent: on all devices but the CPU.

        `placed_by_caller`: `counted` and `summed` are left to be placed beside other fields of a sphere. `works`: walls move,
        and their work is summed.
        """
        self.works = works
        self.sums = 3 if works else 2
        self.particle_count = particle_count
        self.account_count = account_count
        self.wide = wide
        self.apart = not on_cpu() if apart is None else apart
        self.rows = particle_count if self.apart else CHUNKS
        seen = particle_count if self.apart else 1
        self.counted = ti.Vector.field(4, ti.i32)
        self.summed = ti.Vector.field(self.sums, float)
        self.pushed = ti.Vector.field(max(account_count, 1), float)
        self.total_count = ti.Vector.field(4, ti.i32)
        self.total_sum = ti.Vector.field(self.sums, wide)
        self.total_push = ti.Vector.field(max(account_count, 1), wide)
        self.two_parts = wide == ti.f32  # a sum that grows through a whole run needs more digits than f32 has
        self.low_sum = ti.Vector.field(self.sums, wide) if self.two_parts else None
        self.low_push = ti.Vector.field(max(account_count, 1), wide) if self.two_parts else None
        self._before = ContactReport()
        self.unresolved = ti.field(ti.i32)
        self.overlap = ti.field(float)
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, self.rows).place(self.total_count)
        builder.dense(ti.i, seen).place(self.unresolved)
        real_builder, wide_builder = ti.FieldsBuilder(), ti.FieldsBuilder()  # apart: see State._builder
        if not placed_by_caller:
            builder.dense(ti.i, particle_count).place(self.counted)
            real_builder.dense(ti.i, particle_count).place(self.summed)
        real_builder.dense(ti.i, particle_count if account_count else 1).place(self.pushed)
        real_builder.dense(ti.i, seen).place(self.overlap)
        self.sum_fields = (self.total_sum, self.total_push, *((self.low_sum, self.low_push) if self.two_parts else ()))
        for field in self.sum_fields:
            wide_builder.dense(ti.i, self.rows).place(field)
        self._trees = [builder.finalize(), real_builder.finalize(), wide_builder.finalize()]

    def destroy(self) -> None:
        """Give the memory back."""
        for tree in self._trees:
            tree.destroy()

    @ti.func
    def begin_of(self, chunk):
        """First sphere of a chunk; 64 bits, because the product may not fit 32."""
        return ti.cast(ti.cast(chunk, ti.i64) * self.particle_count // CHUNKS, ti.i32)

    @ti.func
    def begin(self, i):
        """Set the counts of sphere i to 0, for a new try."""
        self.counted[i] = ti.Vector.zero(ti.i32, 4)
        self.summed[i] = ti.Vector.zero(float, self.sums)
        if ti.static(self.account_count > 0):
            self.pushed[i] = ti.Vector.zero(float, self.account_count)

    @ti.func
    def add_pair(self, i, impulse, distance, lost, elastic):
        """Count a contact of two spheres with one of them; Δp·r is impulse times distance."""
        self.counted[i] = self.counted[i] + ti.Vector([1, 0, elastic, 0])
        self.summed[i][VIRIAL] = self.summed[i][VIRIAL] + impulse * distance
        self.summed[i][LOST] = self.summed[i][LOST] + lost

    @ti.func
    def add_wall(self, i, account, impulse, lost, elastic, work):
        """Count a contact with a surface, whose impulses are summed under the number `account`; `work` of the wall."""
        self.counted[i] = self.counted[i] + ti.Vector([0, 1, elastic, 0])
        self.summed[i][LOST] = self.summed[i][LOST] + lost
        if ti.static(self.works):
            self.summed[i][WORK] = self.summed[i][WORK] + work
        for k in ti.static(range(self.account_count)):
            if k == account:
                self.pushed[i][k] = self.pushed[i][k] + ti.abs(impulse)

    @ti.func
    def fail(self, i, contacts):
        """Count contacts of sphere i that are given up in this try."""
        self.counted[i] = self.counted[i] + ti.Vector([0, 0, 0, contacts])

    @ti.func
    def keep(self, chunk, i):
        """Add the counts of sphere i to the totals of a chunk, or of the sphere; one thread writes to each chunk."""
        self.total_count[chunk] = self.total_count[chunk] + self.counted[i]
        self._grow(self.total_sum, self.low_sum, chunk, self.summed[i])
        if ti.static(self.account_count > 0):
            self._grow(self.total_push, self.low_push, chunk, self.pushed[i])

    @ti.func
    def _grow(self, total: Template, low: Template, chunk, more: Template):
        """Add to the sums of a chunk, and in two parts to their low parts what rounding leaves out."""
        if ti.static(self.two_parts):
            for k in ti.static(range(total.n)):
                rounded, rest = two_sum(total[chunk][k], more[k])
                total[chunk][k] = rounded
                low[chunk][k] = low[chunk][k] + rest
        else:
            total[chunk] = total[chunk] + ti.cast(more, self.wide)

    @ti.func
    def see_overlap(self, i, overlap):
        """Note an overlap that the thread of sphere i sees; the largest overlap does not depend on the order."""
        if ti.static(not self.apart):
            if overlap > self.overlap[0]:
                ti.atomic_max(self.overlap[0], overlap)
        else:
            self.overlap[i] = ti.max(self.overlap[i], overlap)

    @ti.func
    def give_up(self, i, contacts):
        """Count contacts that the thread of sphere i leaves unresolved, whatever is tried."""
        if ti.static(not self.apart):
            ti.atomic_add(self.unresolved[0], contacts)
        else:
            self.unresolved[i] = self.unresolved[i] + contacts

    @ti.kernel
    def _take(self, counts: ti.types.ndarray(ndim=2), reals: ti.types.ndarray(ndim=2)):
        """Sum up each stripe of totals and find the largest overlap, in one launch; set to 0 all but the sums of real numbers.

        Columns of `reals`: the sums, the largest overlap, and in two parts the low parts of the sums.
        """
        for stripe in range(counts.shape[0]):
            count = ti.Vector.zero(ti.i32, 4)
            total = ti.Vector.zero(self.wide, self.sums)
            push = ti.Vector.zero(self.wide, self.total_push.n)
            low, low_push = ti.Vector.zero(self.wide, self.sums), ti.Vector.zero(self.wide, self.total_push.n)
            given_up = 0
            overlap = ti.cast(0.0, float)
            for turn in range((self.rows - stripe + STRIPES - 1) // STRIPES):
                i = stripe + turn * STRIPES
                count += self.total_count[i]
                self._add_up(total, low, self.total_sum, self.low_sum, i)
                self._add_up(push, low_push, self.total_push, self.low_push, i)
                self.total_count[i] = ti.Vector.zero(ti.i32, 4)
                if ti.static(self.apart) or i == 0:
                    given_up += self.unresolved[i]
                    overlap = ti.max(overlap, self.overlap[i])
                    self.unresolved[i] = 0
                    self.overlap[i] = 0.0
            for k in ti.static(range(4)):
                counts[stripe, k] = count[k]
            counts[stripe, 4] = given_up
            for k in ti.static(range(self.sums)):
                reals[stripe, k] = total[k]
            for k in ti.static(range(self.total_push.n)):
                reals[stripe, self.sums + k] = push[k]
            reals[stripe, self.sums + self.total_push.n] = ti.cast(overlap, self.wide)
            if ti.static(self.two_parts):
                for k in ti.static(range(self.sums)):
                    reals[stripe, self.sums + 1 + self.total_push.n + k] = low[k]
                for k in ti.static(range(self.total_push.n)):
                    reals[stripe, 2 * self.sums + 1 + self.total_push.n + k] = low_push[k]

    @ti.func
    def _add_up(self, sums: Template, rests: Template, total: Template, low: Template, i):
        """Add the totals of row i to the sums of a stripe."""
        if ti.static(self.two_parts):
            for k in ti.static(range(total.n)):
                rounded, rest = two_sum(sums[k], total[i][k])
                sums[k] = rounded
                rests[k] += rest + low[i][k]
        else:
            sums += total[i]

    def collect(self) -> ContactReport:
        """Totals since the last call."""
        stripes, sum_count = min(STRIPES, self.rows), self.sums + self.total_push.n
        whole = np.zeros((stripes, 5), np.int32)
        reals = np.zeros((stripes, (2 if self.two_parts else 1) * sum_count + 1), np.float32 if self.two_parts else np.float64)
        self._take(whole, reals)
        counts = whole.astype(np.int64).sum(0)
        real = reals.astype(np.float64).sum(0)
        real = real[:sum_count] + real[sum_count + 1 :] if self.two_parts else real[:sum_count]
        sums, pushes = real[: self.sums], real[self.sums :]
        now = ContactReport(
            pair_count=int(counts[PAIRS]),
            wall_count=int(counts[WALLS]),
            elastic_count=int(counts[ELASTIC]),
            virial=float(sums[VIRIAL]),
            wall_impulse=tuple(float(p) for p in pushes[: self.account_count]),
            dissipated_energy=float(sums[LOST]),
            wall_work=float(sums[WORK]) if self.works else 0.0,
            largest_overlap=float(reals[:, sum_count].max()),
            unresolved=int(counts[FAILED] + counts[GIVEN_UP]),
        )
        since, self._before = now.sums_since(self._before), now
        return since
