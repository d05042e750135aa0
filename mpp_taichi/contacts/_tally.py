"""What a solver counts: for each sphere while a drift is tried, and once it stands, in sums of a fixed order."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.contacts._base import ContactReport

CHUNKS = 64  # of the spheres; fixed, so that sums do not depend on the threads
PAIRS, WALLS, ELASTIC = 0, 1, 2
VIRIAL, LOST = 0, 1


@ti.data_oriented
class Tally:
    """counted (pairs, walls, elastic), summed (virial, dissipated energy), pushed (impulse on each surface) per sphere."""

    def __init__(self, particle_count: int, surface_count: int, wide: Any) -> None:
        """Allocate; `wide` is the type of the sums."""
        self.particle_count = particle_count
        self.surface_count = surface_count
        self.wide = wide
        self.counted = ti.Vector.field(3, ti.i32)
        self.summed = ti.Vector.field(2, float)
        self.pushed = ti.Vector.field(max(surface_count, 1), float)
        self.total_count = ti.Vector.field(3, ti.i32)
        self.total_sum = ti.Vector.field(2, wide)
        self.total_push = ti.Vector.field(max(surface_count, 1), wide)
        self.unresolved = ti.field(ti.i32)
        self.overlap = ti.field(float)
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, particle_count).place(self.counted, self.summed)
        builder.dense(ti.i, particle_count if surface_count else 1).place(self.pushed)
        builder.dense(ti.i, CHUNKS).place(self.total_count)
        for field in (self.unresolved, self.overlap):
            builder.dense(ti.i, 1).place(field)
        wide_builder = ti.FieldsBuilder()  # 8-byte numbers beside 4-byte ones may come to lie across their alignment
        for field in (self.total_sum, self.total_push):
            wide_builder.dense(ti.i, CHUNKS).place(field)
        self._trees = [builder.finalize(), wide_builder.finalize()]

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
        """Nothing counted yet for sphere i in this try."""
        self.counted[i] = ti.Vector.zero(ti.i32, 3)
        self.summed[i] = ti.Vector.zero(float, 2)
        if ti.static(self.surface_count > 0):
            self.pushed[i] = ti.Vector.zero(float, self.surface_count)

    @ti.func
    def add_pair(self, i, impulse, distance, lost, elastic):
        """A contact of two spheres, kept with one of them; Δp·r is impulse times distance."""
        self.counted[i] = self.counted[i] + ti.Vector([1, 0, elastic])
        self.summed[i] = self.summed[i] + ti.Vector([impulse * distance, lost])

    @ti.func
    def add_wall(self, i, surface, impulse, lost, elastic):
        """A contact with a surface."""
        self.counted[i] = self.counted[i] + ti.Vector([0, 1, elastic])
        self.summed[i] = self.summed[i] + ti.Vector([0.0, lost])
        for s in ti.static(range(self.surface_count)):
            if s == surface:
                self.pushed[i][s] = self.pushed[i][s] + ti.abs(impulse)

    @ti.func
    def keep(self, chunk, i):
        """Add what sphere i counted to a chunk's totals; each chunk by one thread."""
        self.total_count[chunk] = self.total_count[chunk] + self.counted[i]
        self.total_sum[chunk] = self.total_sum[chunk] + ti.cast(self.summed[i], self.wide)
        if ti.static(self.surface_count > 0):
            self.total_push[chunk] = self.total_push[chunk] + ti.cast(self.pushed[i], self.wide)

    @ti.func
    def see_overlap(self, overlap):
        """The largest has no order."""
        if overlap > self.overlap[0]:
            ti.atomic_max(self.overlap[0], overlap)

    @ti.func
    def give_up(self, contacts):
        """Count contacts that were left unresolved."""
        ti.atomic_add(self.unresolved[0], contacts)

    def collect(self) -> ContactReport:
        """Totals since it was last asked."""
        counts = np.zeros((CHUNKS, 3 + 1), np.int32)
        reals = np.zeros((CHUNKS, 2 + self.total_push.n + 1), np.float32 if self.wide == ti.f32 else np.float64)
        self._take(counts, reals)
        unresolved, overlap = counts[0, -1], reals[0, -1]
        counts = counts.astype(np.int64).sum(0)
        sums, pushes = reals[:, :2].sum(0), reals[:, 2:-1].sum(0)
        return ContactReport(
            pair_count=int(counts[PAIRS]),
            wall_count=int(counts[WALLS]),
            elastic_count=int(counts[ELASTIC]),
            virial=float(sums[VIRIAL]),
            wall_impulse=tuple(float(p) for p in pushes[: self.surface_count]),
            dissipated_energy=float(sums[LOST]),
            largest_overlap=float(overlap),
            unresolved=int(unresolved),
        )

    @ti.kernel
    def _take(self, counts: ti.types.ndarray(ndim=2), reals: ti.types.ndarray(ndim=2)):
        """Hand out the totals of each chunk, and with the first what there is but once; all begin anew, in one launch."""
        for chunk in range(CHUNKS):
            for k in ti.static(range(3)):
                counts[chunk, k] = self.total_count[chunk][k]
                self.total_count[chunk][k] = 0
            for k in ti.static(range(2)):
                reals[chunk, k] = self.total_sum[chunk][k]
                self.total_sum[chunk][k] = 0.0
            for k in ti.static(range(self.total_push.n)):
                reals[chunk, 2 + k] = self.total_push[chunk][k]
                self.total_push[chunk][k] = 0.0
            if chunk == 0:
                counts[0, 3] = self.unresolved[0]
                self.unresolved[0] = 0
                reals[0, 2 + self.total_push.n] = self.overlap[0]
                self.overlap[0] = 0.0
