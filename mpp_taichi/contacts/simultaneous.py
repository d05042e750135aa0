"""Time-stepped hard spheres; all contacts that touch at one instant are resolved together."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactReport, ContactSetup, ContactSolver
from mpp_taichi.contacts._contact_group import ContactGroup
from mpp_taichi.contacts._reflections import Reflections
from mpp_taichi.types import Template
from mpp_taichi.walls import _geometry
from mpp_taichi.walls._roots import first_contact_curved

CONTACTS_EACH = 8  # contacts for which there is room, per sphere
EVENTS = 10_000_000  # instants of contact in one drift, after which it is given up


@ti.data_oriented
@component
class Simultaneous(ContactSolver):
    """Spheres fly straight from one instant of contact to the next, and what touches then is resolved as a group.

    Groups are resolved by generalized reflections (`_reflections.py`): independent of numbering, symmetric where the scene is,
    energy kept where e = 1, and a row of touching balls passes on as many as come in. Spheres count as touching up to a gap
    of ε^(2/3) of their reach, ε the rounding unit: symmetric events that have grown apart by as much still are simultaneous.

    Every pair is looked at for every instant, so it is for some hundreds of spheres.
    """

    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="e, relative speed after over before; 1: elastic")
    contact_time: float = param(
        0.0, minimum=0.0, unit="time", help="t_c: contacts within it after the last are elastic; 0: off"
    )

    drifts = True

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        self.setup = setup
        n = setup.particle_count
        self.dimensions = setup.dimensions
        self.particle_count = n
        self.surfaces = setup.enclosure.surfaces
        self.period = setup.enclosure.period
        self.t_c = setup.contact_time
        capacity = min(n * (n - 1) // 2, CONTACTS_EACH * n) + n * len(self.surfaces)
        self.group = ContactGroup(setup, capacity)
        self.reflections = Reflections(self.group)
        self.touching = self.group.epsilon ** (2 / 3)
        builder = ti.FieldsBuilder()
        self.radius, self.last_contact, self.pair_restitution = (ti.field(float) for _ in range(3))
        self.material = ti.field(ti.i32)
        for row in (self.radius, self.material, self.last_contact):
            builder.dense(ti.i, n).place(row)
        builder.dense(ti.ij, setup.restitution.shape).place(self.pair_restitution)
        self.counts = ti.field(ti.i32)  # pairs, walls, elastic, unresolved
        builder.dense(ti.i, 4).place(self.counts)
        trees = [builder.finalize()]
        builder = ti.FieldsBuilder()
        self.sums = ti.field(state.wide)  # virial, dissipated energy, largest overlap, then the impulse on each surface
        builder.dense(ti.i, 3 + len(self.surfaces)).place(self.sums)
        self._trees = [*trees, builder.finalize()]
        kind = self.radius.to_numpy().dtype
        self.radius.from_numpy(setup.radius.astype(kind))
        self.material.from_numpy(setup.material.astype(np.int32))
        self.pair_restitution.from_numpy(setup.restitution.astype(kind))
        self.last_contact.fill(-1e30)

    def destroy(self) -> None:
        """Give the memory back."""
        self.reflections.destroy()
        self.group.destroy()
        for tree in self._trees:
            tree.destroy()

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move all spheres by h [time] along their velocities, with the contacts on the way."""
        self._drift(state, time, h)

    def collect(self) -> ContactReport:
        """What was counted since it was last asked."""
        counts, sums = self.counts.to_numpy(), self.sums.to_numpy()
        self.counts.fill(0)
        self.sums.fill(0)
        return ContactReport(
            pair_count=int(counts[0]),
            wall_count=int(counts[1]),
            elastic_count=int(counts[2]),
            virial=float(sums[0]),
            wall_impulse=tuple(float(x) for x in sums[3:]),
            dissipated_energy=float(sums[1]),
            largest_overlap=float(sums[2]),
            unresolved=int(counts[3]),
        )

    @ti.kernel
    def _drift(self, state: Template, start: float, h: float):
        ti.loop_config(serialize=True)
        for _ in range(1):
            passed = ti.cast(0.0, float)
            events = 0
            while passed < h:
                step = self._time_to_contact(state, start + passed, h - passed)
                last = step > h - passed  # there is none: infinity
                if last:
                    step = h - passed
                for i in range(self.particle_count):
                    state.position[i] = state.position[i] + step * state.velocity[i]
                passed = h if last else passed + step
                if not last:
                    self._resolve(state, start + passed)
                    events += 1
                    if events > EVENTS:
                        self.counts[3] = self.counts[3] + 1
                        passed = h

    @ti.func
    def _separation(self, state: Template, i, j):
        """Position of i seen from the nearest image of j."""
        r = state.position[i] - state.position[j]
        for k in ti.static(range(self.dimensions)):
            if ti.static(self.period[k] > 0.0):
                r[k] = r[k] - self.period[k] * ti.round(r[k] / self.period[k])
        return r

    @ti.func
    def _time_to_contact(self, state: Template, time, horizon):
        """Earliest instant from now at which something meets; infinity if that is beyond the horizon."""
        earliest = ti.cast(ti.math.inf, float)
        limit = self._least_speed(state)
        for i in range(self.particle_count):
            x, v = state.position[i], state.velocity[i]
            for j in range(i):
                r = self._separation(state, i, j)
                u = v - state.velocity[j]
                reach = self.radius[i] + self.radius[j]
                approach = r.dot(u)
                distance = r.norm()
                touches = distance - reach <= self.touching * reach
                if approach < 0.0 and not (touches and -approach <= limit * distance) and self._moves(i, j):
                    when = 0.0 if touches else first_contact_curved(r, u, reach, False, horizon)
                    earliest = ti.min(earliest, when)
            for s in ti.static(range(len(self.surfaces))):
                n = _geometry.normal(self.surfaces[s], x, time)
                approach = n.dot(v - _geometry.surface_velocity(self.surfaces[s], x))
                touches = _geometry.gap(self.surfaces[s], x, self.radius[i], time) <= self.touching * self.radius[i]
                if n.dot(self.group.inverse_mass[i] * n) > 0.0 and not (touches and approach >= -limit):
                    when = _geometry.time_of_contact(self.surfaces[s], x, v, self.radius[i], time, horizon)
                    earliest = ti.min(earliest, 0.0 if touches else when)
        return earliest

    @ti.func
    def _moves(self, i, j):
        """Whether a contact can change anything: two held spheres pass through each other."""
        return (self.group.inverse_mass[i] + self.group.inverse_mass[j]).max() > 0.0

    @ti.func
    def _least_speed(self, state: Template):
        """Slower approaches are round-off of the fastest sphere or surface."""
        largest = ti.cast(0.0, float)
        for i in range(self.particle_count):
            largest = ti.max(largest, state.velocity[i].norm())
        for s in ti.static(range(len(self.surfaces))):
            largest = ti.max(largest, _geometry.surface_velocity(self.surfaces[s], state.velocity[0]).norm())
        return 2.0 * self.group.threshold * largest

    @ti.func
    def _resolve(self, state: Template, time):
        """Collect what touches now, and resolve it."""
        count = 0
        for i in range(self.particle_count):
            x = state.position[i]
            for j in range(i):
                r = self._separation(state, i, j)
                reach = self.radius[i] + self.radius[j]
                distance = r.norm()
                if distance - reach <= self.touching * reach and self._moves(i, j):
                    smaller = ti.min(self.radius[i], self.radius[j])
                    self._note_overlap(state, (reach - distance) / smaller)
                    e = self.pair_restitution[self.material[i], self.material[j]]
                    count = self._add(count, i, j, r / distance, 0.0, e, time)
            for s in ti.static(range(len(self.surfaces))):
                gap = _geometry.gap(self.surfaces[s], x, self.radius[i], time)
                if gap <= self.touching * self.radius[i]:
                    self._note_overlap(state, -gap / self.radius[i])
                    n = _geometry.normal(self.surfaces[s], x, time)
                    speed = n.dot(_geometry.surface_velocity(self.surfaces[s], x))
                    count = self._add(count, i, -1 - s, n, speed, ti.cast(ti.static(self.surfaces[s].restitution), float), time)
        if count > self.group.capacity:
            self.counts[3] = self.counts[3] + count - self.group.capacity
            count = self.group.capacity
        outcome = self.reflections.resolve(state, count)
        self.counts[3] = self.counts[3] + outcome[1]
        self._account(state, count, time)

    @ti.func
    def _note_overlap(self, state: Template, overlap):
        self.sums[2] = ti.max(self.sums[2], ti.cast(overlap, state.wide))

    @ti.func
    def _add(self, count, i, second, n, surface_speed, restitution, time):
        """A row of the group; a contact soon after the last of one of its spheres is elastic."""
        if count < self.group.capacity:
            e = ti.cast(restitution, float)
            made_elastic = False
            if ti.static(self.t_c > 0.0):
                recent = time - self.last_contact[i] < self.t_c
                if second >= 0:
                    recent = recent or time - self.last_contact[second] < self.t_c
                made_elastic = recent and e < 1.0
                e = 1.0 if recent else e
            self.group.first[count] = i
            self.group.second[count] = second
            self.group.normal[count] = n
            self.group.surface_speed[count] = surface_speed
            self.group.restitution[count] = e
            self.group.impulse[count] = 0.0
            self.group.lost[count] = 0.0
            self.group.hits[count] = 0
            self.group.made_elastic[count] = ti.cast(made_elastic, ti.i32)
        return count + 1

    @ti.func
    def _account(self, state: Template, count, time):
        """Counts and sums of the contacts that were hit."""
        for c in range(count):
            if self.group.hits[c] > 0:
                i, j = self.group.first[c], self.group.second[c]
                impulse = ti.cast(self.group.impulse[c], state.wide)
                self.last_contact[i] = time
                self.counts[2] = self.counts[2] + self.group.hits[c] * self.group.made_elastic[c]
                self.sums[1] = self.sums[1] + ti.cast(self.group.lost[c], state.wide)
                if j >= 0:
                    self.last_contact[j] = time
                    self.counts[0] = self.counts[0] + self.group.hits[c]
                    self.sums[0] = self.sums[0] + impulse * (self.radius[i] + self.radius[j])
                else:
                    self.counts[1] = self.counts[1] + self.group.hits[c]
                    self.sums[2 - j] = self.sums[2 - j] + ti.abs(impulse)
