"""A drift with impacts and resting contacts, for piles: the loops over spheres and their rows."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.error_free import two_sum
from mpp_taichi.arithmetic.particle_update import drifted
from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.rest.complementarity import CHUNK, Complementarity
from mpp_taichi.contacts.rest.contact_rows import ContactRows
from mpp_taichi.contacts.shared.impulse import impulse_between, pushed
from mpp_taichi.types import Template

ROOM = 1.25  # speed that the rows allow for, over the largest speed; a faster sphere has wider rows built
OPEN = 1e-3  # of the smaller radius: a smaller gap is that of a contact, through which a shock passes in one projection
PAIRS, WALLS, VIRIAL, LOST, MISSED, PUSHED = 0, 1, 2, 3, 4, 5


@ti.data_oriented
class RestingStep:
    """The loops of a drift over all spheres.

    left        (n,) velocities at the end of the last drift
    final       (n,) velocities at the end of this drift
    partner_e   (n,) least restitution of the impacts that a sphere is connected to, directly or through other spheres
    overlap     (n,) largest overlap that was seen, relative to the smaller radius
    missed      (n,) energy of the rebounds that a sphere had no room for in this drift, which met others again after an impact
    sums        of each chunk of spheres: impacts of pairs and with surfaces, virial, energy lost, energy of rebounds that were
                missed, impulse on each wall; they grow through a phase. `low_sums` is what f32 leaves out of them.
    """

    def __init__(self, setup: ContactSetup, tolerance: float, wide: Any, compliance: float = 0.0):
        """Allocate for the spheres of `setup`; `wide` is the type of sums."""
        self.rows = ContactRows(setup)
        self.solver = Complementarity(self.rows, tolerance, wide, compliance)
        self.particle_count = setup.particle_count
        self.dimensions = setup.dimensions
        self.walls = self.rows.walls
        self.wide = wide
        restitutions = {float(e) for e in setup.restitution.ravel()} | {surface.restitution for surface in self.walls.surfaces}
        self.mixed = len(restitutions) > 1
        builder = ti.FieldsBuilder()
        self.left, self.final = (ti.Vector.field(self.dimensions, float) for _ in range(2))
        self.partner_e, self.overlap, self.missed = ti.field(float), ti.field(float), ti.field(float)
        for field in (self.left, self.final, self.partner_e, self.overlap, self.missed):
            builder.dense(ti.i, self.particle_count).place(field)
        self._trees = [builder.finalize()]
        builder = ti.FieldsBuilder()
        self.sums = ti.Vector.field(PUSHED + self.walls.account_count, wide)
        self.two_parts = wide == ti.f32  # a sum that grows through a whole run needs more digits than f32 has
        self.low_sums = ti.Vector.field(PUSHED + self.walls.account_count, wide) if self.two_parts else None
        self.sum_fields = (self.sums, self.low_sums) if self.two_parts else (self.sums,)
        for field in self.sum_fields:
            builder.dense(ti.i, self.solver.chunk_count).place(field)
        self._trees.append(builder.finalize())

    def destroy(self) -> None:
        """Give the memory back."""
        self.solver.destroy()
        self.rows.destroy()
        for tree in self._trees:
            tree.destroy()

    def forget(self) -> None:
        """Forget the last drift."""
        self.left.fill(0)
        self.rows.start.fill(0)
        self.rows.old_start.fill(0)

    @ti.func
    def measure(self, velocity: Template):
        """total[0] becomes (largest speed, largest change since the last drift)."""
        for i in range(self.particle_count):
            v = velocity[i]
            self.solver.terms[i] = ti.Vector([v.norm(), (v - self.left[i]).norm()])
        self.solver.reduce_largest()

    @ti.func
    def begin_rows(self):
        """Set the counts of all rows to 0."""
        for i in range(self.particle_count):
            self.rows.filled[i] = 0

    @ti.func
    def add_all_pairs(self, state: Template, bound, time, h, filling):
        """Count or fill in the spheres and surfaces near each sphere, by a test of all pairs."""
        for i in range(self.particle_count):
            for j in range(self.particle_count):
                separation = self.rows.separation(state, i, j)
                self.rows.add_sphere(i, j, separation, 2.0 * h * bound, filling)
            self.rows.add_surfaces(state, i, bound, time, h, filling)

    @ti.func
    def find_impacts(self, state: Template, time, h, resting_speed):
        """Mark the impacts; total[0][0] becomes the largest number of impacts of a sphere."""
        for i in range(self.particle_count):
            impacts = 0
            for c in range(self.rows.start[i], self.rows.start[i + 1]):
                self.overlap[i] = ti.max(self.overlap[i], -self.rows.gap[c] / self.rows.smaller_radius(i, c))
                separation = self.rows.separation(state, i, ti.max(self.rows.other[c], 0))
                self.rows.find_impact(state, separation, i, c, time, h, resting_speed)
                impacts += self.rows.impact[c]
            self.solver.terms[i] = ti.Vector([ti.cast(impacts, float), 0.0])
            self.partner_e[i] = 1.0
        self.solver.reduce_largest()

    @ti.func
    def begin_impacts(self, state: Template):
        """Begin the problem with only the impacts, none of which may approach."""
        for i in range(self.particle_count):
            self.solver.base[i] = state.velocity[i]
            for c in range(self.rows.start[i], self.rows.start[i + 1]):
                if self.rows.impact[c] == 1:
                    self.rows.impulse[c] = 0.0
                    self.solver.offset[c] = 0.0

    @ti.func
    def spread_restitution(self):
        """Give each sphere the least restitution of its impacts; total[0][0] becomes 0 when none has changed."""
        for i in range(self.particle_count):
            least = self.partner_e[i]
            for c in range(self.rows.start[i], self.rows.start[i + 1]):
                if self.rows.impact[c] == 1:
                    least = ti.min(least, self._restitution(i, c))
            changed = least < self.partner_e[i]
            self.partner_e[i] = least
            self.solver.terms[i] = ti.Vector([ti.cast(changed, float), 0.0])
        self.solver.reduce_largest()

    @ti.func
    def _restitution(self, i, c):
        """Restitution of an impact: the least of all impacts that it is connected to."""
        e = self.rows.restitution_of(i, c)
        if ti.static(self.mixed):
            j = self.rows.other[c]
            if self.rows.inverse_mass[i].max() > 0.0:
                e = ti.min(e, self.partner_e[i])
            if j >= 0:
                if self.rows.inverse_mass[j].max() > 0.0:
                    e = ti.min(e, self.partner_e[j])
        return e

    @ti.func
    def end_impacts(self, state: Template):
        """Give impacts 1 + e times the impulses that ended their approach; the velocity after a lone impact is rounded once."""
        for i in range(self.particle_count):
            change = ti.Vector.zero(float, self.dimensions)
            v, w = state.velocity[i], self.rows.inverse_mass[i]
            alone = self._has_one_impact(i)
            for c in range(self.rows.start[i], self.rows.start[i + 1]):
                if self.rows.impact[c] == 1:
                    e, n, j = self._restitution(i, c), self.rows.normal[c], self.rows.other[c]
                    given = (1.0 + e) * self.rows.impulse[c]
                    if alone and (j < 0 or self._has_one_impact(ti.max(j, 0))):
                        other_w = self.rows.inverse_mass[ti.max(j, 0)] * ti.cast(j >= 0, float)
                        found = impulse_between(n, v, self.rows.velocity_of_other(state.velocity, c), w, other_w, e)
                        given = found[0]
                        self.solver.base[i] = pushed(v, w, n, given, found[1], 1)
                    else:
                        change += given * n
                    self.rows.given[c] = given
                    self.rows.impulse[c] = 0.0
            self.solver.base[i] = self.solver.base[i] + w * change

    @ti.func
    def _has_one_impact(self, i):
        """Whether sphere i has a single impact in this drift, or does not move by its impacts."""
        impacts = 0
        for c in range(self.rows.start[i], self.rows.start[i + 1]):
            impacts += self.rows.impact[c]
        return impacts == 1 or self.rows.inverse_mass[i].max() == 0.0

    @ti.func
    def begin_rest(self, state: Template, h, after_impacts):
        """Begin the problem of all entries: none may approach farther than its gap by the end of the drift.

        What impacts overlap is left to the ways: a speed that ends it would add energy to every bounce.
        """
        for i in range(self.particle_count):
            if after_impacts == 0:
                self.solver.base[i] = state.velocity[i]
        for i in range(self.particle_count):
            self.missed[i] = self._missed(i, h) if after_impacts == 1 else 0.0
            for c in range(self.rows.start[i], self.rows.start[i + 1]):
                gap = self.rows.gap[c]
                self.solver.offset[c] = (ti.max(gap, 0.0) if self.rows.impact[c] == 1 else gap) / h

    @ti.func
    def _missed(self, i, h):
        """Energy of the rebounds of sphere i that this drift leaves out.

        After an impact the sphere approaches, over an open gap, another one or a surface so fast that it would rebound within
        the drift; the problem of rest only ends the approach. A rebound with e would leave ½ μ e² u² of the energy of the
        approach u, and ½ μ (gap/h)² is left. Pairs are counted in the row of the greater number.
        """
        energy = ti.cast(0.0, float)
        for c in range(self.rows.start[i], self.rows.start[i + 1]):
            j, n, gap = self.rows.other[c], self.rows.normal[c], self.rows.gap[c]
            if self.rows.impact[c] == 0 and j < i and gap > OPEN * self.rows.smaller_radius(i, c):
                u = n.dot(self.rows.velocity_of_other(self.solver.base, c) - self.solver.base[i])
                w = (n * n).dot(self.rows.inverse_mass[i] + self.rows.inverse_mass[ti.max(j, 0)] * ti.cast(j >= 0, float))
                e = self.rows.restitution_of(i, c)
                if u * h > gap and w > 0.0:
                    energy += ti.max(0.0, 0.5 * (e * e * u * u - (gap / h) ** 2) / w)
        return energy

    @ti.func
    def end_rest(self):
        """Keep the velocities that were found, and the impulses of the resting contacts."""
        for i in range(self.particle_count):
            self.final[i] = self.solver.velocity[i]
            for c in range(self.rows.start[i], self.rows.start[i + 1]):
                self.rows.resting[c] = self.rows.impulse[c]

    @ti.func
    def begin_ways(self, state: Template, h):
        """Begin the problem of the mean velocities: old velocities until the first impact of a sphere, then new velocities.

        Contacts that yielded keep their overlap.
        """
        for i in range(self.particle_count):
            when = ti.cast(0.0, float)
            hit = False
            for c in range(self.rows.start[i], self.rows.start[i + 1]):
                self.rows.impulse[c] = 0.0
                self.solver.offset[c] = self.rows.gap[c] / h
                if ti.static(self.solver.compliance > 0.0):
                    self.solver.offset[c] = self.solver.offset[c] + self.solver.softness[0] * self.rows.resting[c]
                if self.rows.given[c] > 0.0:
                    when = ti.min(when, self.rows.when[c]) if hit else self.rows.when[c]
                    hit = True
            self.solver.base[i] = self.final[i] + (when / h) * (state.velocity[i] - self.final[i])

    @ti.func
    def move(self, state: Template, h):
        """Count the contacts, and move all spheres by h times the velocities of the last problem."""
        for k in range(self.solver.chunk_count):
            for i in range(k * CHUNK, ti.min((k + 1) * CHUNK, self.particle_count)):
                self._count(state, k, i)
        for i in range(self.particle_count):
            state.velocity[i] = self.final[i]
            self.left[i] = self.final[i]
            state.position[i] = drifted(state.position[i], self.solver.velocity[i], h)

    @ti.func
    def _count(self, state: Template, k, i):
        """Add the contacts of sphere i to the sums of chunk k; a pair is counted in the row of its greater number."""
        for axis in ti.static(range(self.dimensions)):
            w = ti.cast(self.rows.inverse_mass[i][axis], self.wide)
            before = ti.cast(state.velocity[i][axis], self.wide)
            after = ti.cast(self.final[i][axis], self.wide)
            if w > 0.0:
                self._add(k, LOST, 0.5 * (before - after) * (before + after) / w)
        self._add(k, MISSED, ti.cast(self.missed[i], self.wide))
        for c in range(self.rows.start[i], self.rows.start[i + 1]):
            j = self.rows.other[c]
            impulse = ti.cast(self.rows.given[c] + self.rows.resting[c], self.wide)
            hit = ti.cast(self.rows.given[c] > 0.0, ti.i32)
            if 0 <= j and j < i:
                self._add(k, PAIRS, hit)
                self._add(k, VIRIAL, impulse * (self.rows.radius[i] + self.rows.radius[j]))
            if ti.static(self.walls.account_count > 0):
                if j < 0:
                    work = impulse * self.rows.normal[c].dot(self.rows.velocity_of_other(state.velocity, c))
                    account = self.walls.account_of(-1 - j)
                    self._add(k, WALLS, hit)
                    self._add(k, LOST, work)
                    for a in ti.static(range(self.walls.account_count)):
                        if a == account:
                            self._add(k, PUSHED + a, impulse)

    @ti.func
    def _add(self, k, which: Template, more):
        """Add to a sum of chunk k."""
        if ti.static(self.two_parts):
            rounded, rest = two_sum(self.sums[k][which], ti.cast(more, self.wide))
            self.sums[k][which] = rounded
            self.low_sums[k][which] = self.low_sums[k][which] + rest
        else:
            self.sums[k][which] = self.sums[k][which] + more
