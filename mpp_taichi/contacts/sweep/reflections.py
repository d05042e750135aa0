"""Generalized reflections: touching contacts resolved together, wave by wave, whatever their numbering."""

import taichi as ti

from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.sweep.contact_group import ContactGroup
from mpp_taichi.contacts.sweep.least_impulse import LeastImpulse
from mpp_taichi.types import Template

PATIENCE = 64, 8  # waves, and waves for each contact, after which it is asked whether the group can still open
WAVES = 10_000_000  # a group that still approaches after so many is given up


@ti.data_oriented
class Reflections:
    """Velocities after a simultaneous impact without friction.

    A wave takes the contacts that approach, divides them into parts that share no movable sphere, and reflects each part,
    v' = v + (1 + e) M⁻¹ Nᵀ λ, with the impulses λ ≥ 0 that would just end its approach (`LeastImpulse`). For e = 1 the new
    velocities are a mirror image in the metric of the kinetic energy, so that the energy is kept; any impulses keep the
    momentum. Waves follow until no contact approaches by more than round-off. As only approaching contacts take part, a shock
    runs through a row of balls by one contact in each wave, and as many balls leave as come in. Where restitutions differ
    within a part, e is their mean weighted by the energy λ b that goes into each contact, so that no part gains energy.

    The waves of an elastic group that can open come to an end. Other groups take the closest velocities at which none of their
    contacts approaches: groups with e = 0 throughout, groups that lose energy and still approach after PATIENCE waves, and
    jammed groups, which no velocity opens.

    Sources: Smith, Kaufman, Vouga, Tamstorf, Grinspun, ACM Trans. Graphics 31 (2012) 106; Vouga, Smith, Kaufman, Tamstorf,
    Grinspun, ACM Trans. Graphics 36 (2017) 151, for when and how reflections end.
    """

    def __init__(self, group: ContactGroup):
        """Bind the contacts."""
        self.group = group
        self.least = LeastImpulse(group)
        self._trees = FieldTrees()
        self.speed = ti.field(float)
        self.part, self.part_size = ti.field(ti.i32), ti.field(ti.i32)
        self._trees.place(group.capacity, self.speed)
        for row in (self.part, self.part_size):
            self._trees.place(group.capacity, integers=[row])
        self.seen_by = ti.field(ti.i32)
        self._trees.place(group.particle_count, integers=[self.seen_by])
        self._trees.finish()

    def destroy(self) -> None:
        """Give the memory back."""
        self.least.destroy()
        self._trees.destroy()

    @ti.func
    def resolve(self, state: Template, count):
        """Change the velocities of the first `count` contacts; returns (waves, contacts that were given up)."""
        waves = 0
        failed = 0
        least_e, largest_e = ti.cast(1.0, float), ti.cast(0.0, float)
        for c in range(count):
            least_e = ti.min(least_e, self.group.restitution[c])
            largest_e = ti.max(largest_e, self.group.restitution[c])
        scale = ti.cast(0.0, float)
        patience = ti.static(PATIENCE[0]) + ti.static(PATIENCE[1]) * count
        ending = 1 if largest_e == 0.0 else 0  # 1: the next wave is the last, of all contacts and without a rebound
        going = 1
        while going == 1:
            testing = 1 if waves == patience and least_e == 1.0 and ending == 0 else 0  # 1: test whether the group is jammed
            scale = ti.max(scale, self.group.speed_scale(state, count))
            active = self._find_parts(state, count, -self.group.threshold * scale, ending + testing)
            reflected = 0
            jammed = 0
            for c in range(count):
                if self.part[c] == c and active > 0:
                    outcome = self._solve_part(state, c, count, ending, testing)
                    failed += ti.max(-outcome, 0)
                    reflected += 1
                    jammed += ti.max(outcome, 0)
            waves += 1
            if active == 0 or failed > 0 or ending == 1:
                going = 0
            elif jammed > 0 or (waves >= patience and least_e < 1.0):
                ending = 1
            elif waves > WAVES:
                failed += active
        return ti.Vector([waves, failed])

    @ti.func
    def _find_parts(self, state: Template, count, limit, all_contacts):
        """Set `part` of each contact to the first contact of its part, −1: not in this wave; returns how many approach."""
        approaching = 0
        for c in range(count):
            self.speed[c] = self.group.separating_speed(state, c)
            movable = self.group.coupling(c, c) > 0.0
            violated = movable and self.speed[c] < limit
            self.part[c] = c if violated or (movable and all_contacts > 0) else -1
            self.part_size[c] = 0
            approaching += 1 if violated else 0
            self.seen_by[self.group.first[c]] = -1
            if self.group.second[c] >= 0:
                self.seen_by[self.group.second[c]] = -1
        for c in range(count):
            if self.part[c] >= 0:
                self._join(c, self.group.first[c])
                if self.group.second[c] >= 0:
                    self._join(c, self.group.second[c])
        for c in range(count):
            if self.part[c] >= 0:
                root = self._root(c)
                self.part[c] = root
                self.part_size[root] = self.part_size[root] + 1
        return approaching

    @ti.func
    def _join(self, c, i):
        """Put c into one part with the contact that had sphere i before; a sphere that cannot move couples no contacts."""
        if self.group.inverse_mass[i].max() > 0.0:
            if self.seen_by[i] >= 0:
                a, b = self._root(c), self._root(self.seen_by[i])
                self.part[ti.max(a, b)] = ti.min(a, b)
            self.seen_by[i] = c

    @ti.func
    def _root(self, c):
        """The first contact of a part; links are shortened on the way."""
        root = c
        while self.part[root] != root:
            self.part[root] = self.part[self.part[root]]
            root = self.part[root]
        return root

    @ti.func
    def _solve_part(self, state: Template, root, count, ending, testing):
        """Reflect a part; returns 1 if it was tested and is jammed, −m if its m contacts were given up, else 0."""
        outcome = 0
        size = self.part_size[root]
        if size == 1 and testing == 0:
            e = (1 - ending) * self.group.restitution[root]
            if self.speed[root] < 0.0:
                self.group.bounce(state, root, e)
        elif size > self.least.capacity:
            outcome = -size
        else:
            members = 0
            for c in range(root, count):
                if self.part[c] == root:
                    width = ti.sqrt(self.group.coupling(c, c))
                    self.least.member[members] = c
                    self.least.size[members] = width
                    self.least.right[members] = 1.0 if testing == 1 else -self.speed[c] / width
                    members += 1
            if self.least.solve(size, ti.cast(testing, float)) == 1:
                outcome = -size
            total, returned = ti.cast(0.0, float), ti.cast(0.0, float)
            for p in range(size):
                if testing == 1:
                    total += self.least.impulse[p]
                else:
                    given = self.least.impulse[p] * self.least.right[p]
                    total += given
                    returned += given * self.group.restitution[self.least.member[p]]
            if testing == 1:
                outcome = 1 if outcome == 0 and 1.0 - total < self.group.threshold * size else outcome
            elif outcome == 0:
                e = returned / total if total > 0.0 and ending == 0 else 0.0
                for p in range(size):
                    if self.least.impulse[p] > 0.0:
                        lost = 0.5 * (1.0 - e * e) * self.least.impulse[p] * self.least.right[p]
                        stop = self.least.impulse[p] / self.least.size[p]
                        self.group.push(state, self.least.member[p], (1.0 + e) * stop, 0.0, lost)
        return outcome
