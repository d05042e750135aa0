"""Spheres and surfaces near each sphere in a drift: compressed sparse rows, each pair of spheres in both of its rows."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.round_off import round_off
from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.neighbors.periodic import nearest_image
from mpp_taichi.types import Template
from mpp_taichi.walls._roots import first_contact_curved
from mpp_taichi.walls._surfaces import WallSurfaces

ROUNDINGS = 16  # of a coordinate, by which an impact may seem later than it is
SEGMENTS_EACH = 8  # mean room of a row for the segments of walls
ENTRIES_EACH = 40  # mean room of a row: enough for the spheres within half a radius of each other in a dense packing
FEW_ENTRIES = 2**18  # room for all pairs of up to 512 spheres, if a drift is so long that each could meet any other


@ti.data_oriented
class ContactRows:
    """Row i is entries start[i] … start[i + 1]: spheres and surfaces that i could touch by the end of the drift.

    other     the other sphere j, or −1 − s for surface s
    normal    unit vector towards i: for an impact at the instant of contact, else at the start of the drift
    gap       distance along the normal [length]
    impact    1 if the entry is hit within the drift, faster than the resting speed
    impulse   along the normal, on i [momentum]; the two entries of a pair have the same bits
    given     impulse of the impact [momentum], `when` [time] after the start of the drift
    resting   impulse of the contact over the drift, without the impulse of the impact [momentum]

    The iteration of the next drift begins with the impulses of the contacts that persist.
    """

    def __init__(self, setup: ContactSetup):
        """Allocate, and fill the fields that do not change."""
        n = setup.particle_count
        self.dimensions = setup.dimensions
        self.particle_count = n
        self.walls = WallSurfaces(setup.enclosure)
        self.period = setup.enclosure.period
        self.epsilon = 2.0 * round_off()
        each = max(ENTRIES_EACH, n - 1) if n * n <= FEW_ENTRIES else ENTRIES_EACH
        self.capacity = (each + self.walls.plain_count + min(self.walls.segment_count, SEGMENTS_EACH)) * n
        numbers, integers = ti.FieldsBuilder(), ti.FieldsBuilder()  # apart: see State._builder
        self.start, self.old_start, self.filled = (ti.field(ti.i32) for _ in range(3))
        self.radius = ti.field(float)
        self.material = ti.field(ti.i32)
        self.inverse_mass = ti.Vector.field(self.dimensions, float)
        for row in (self.start, self.old_start, self.filled, self.material):
            integers.dense(ti.i, n + 1).place(row)
        for row in (self.radius, self.inverse_mass):
            numbers.dense(ti.i, n + 1).place(row)
        self.other, self.old_other, self.impact = (ti.field(ti.i32) for _ in range(3))
        self.normal = ti.Vector.field(self.dimensions, float)
        self.gap, self.impulse, self.old_impulse = (ti.field(float) for _ in range(3))
        self.given, self.when, self.resting = (ti.field(float) for _ in range(3))
        for row in (self.other, self.old_other, self.impact):
            integers.dense(ti.i, self.capacity).place(row)
        for row in (self.normal, self.gap, self.impulse, self.old_impulse, self.given, self.when, self.resting):
            numbers.dense(ti.i, self.capacity).place(row)
        self.restitution = ti.field(float)
        numbers.dense(ti.ij, setup.restitution.shape).place(self.restitution)
        self._trees = [numbers.finalize(), integers.finalize()]
        self._fill(self.radius, setup.radius)
        self._fill(self.material, setup.material)
        self._fill(self.inverse_mass, setup.inverse_mass[:, : self.dimensions])
        self.restitution.from_numpy(setup.restitution.astype(self.restitution.to_numpy().dtype))

    @staticmethod
    def _fill(target: Any, values: np.ndarray) -> None:
        whole = target.to_numpy()
        whole[: len(values)] = values
        target.from_numpy(whole)

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.walls, *self._trees):
            part.destroy()

    # Construction; each func is a loop for the top level of a kernel, or for the inside of a serial loop

    @ti.func
    def remember(self):
        """Keep the impulses of these rows for the rows of the next drift."""
        for i in range(self.particle_count):
            self.old_start[i] = self.start[i]
            self.old_start[i + 1] = self.start[i + 1]
            for c in range(self.start[i], self.start[i + 1]):
                self.old_other[c] = self.other[c]
                self.old_impulse[c] = self.resting[c]

    @ti.func
    def number(self):
        """Sum the counts in `filled` to `start`; start[n] becomes the number of entries."""
        for _ in range(1):
            total = 0
            for i in range(self.particle_count):
                self.start[i] = total
                total += self.filled[i]
            self.start[self.particle_count] = total

    @ti.func
    def clear(self):
        """Remove all entries, if there is no room for them."""
        for i in range(self.particle_count):
            self.start[i] = 0
            self.start[i + 1] = 0

    @ti.func
    def separation(self, state: Template, i, j):
        """From i to the nearest image of j."""
        return nearest_image(state.position[j] - state.position[i], self.period)

    @ti.func
    def add_sphere(self, i, j, separation, margin, filling):
        """Count or fill in sphere j, which is `separation` away from i, if its gap is within the margin."""
        distance = separation.norm()
        gap = distance - (self.radius[i] + self.radius[j])
        if i != j and gap <= margin and (self.inverse_mass[i] + self.inverse_mass[j]).max() > 0.0:
            if filling > 0:
                self._set(self.start[i] + self.filled[i], i, j, separation * (-1.0 / distance), gap, filling)
            self.filled[i] = self.filled[i] + 1

    @ti.func
    def add_surfaces(self, state: Template, i, bound, time, h, filling):
        """Count or fill in the surfaces that a sphere of at most the speed `bound` can reach within h."""
        for s in ti.static(range(self.walls.plain_count)):
            self._add_surface(s, state, i, bound, time, h, filling)
        if ti.static(self.walls.segment_count > 0):
            for g in range(self.walls.segment_count):
                self._add_surface(self.walls.plain_count + g, state, i, bound, time, h, filling)

    @ti.func
    def _add_surface(self, s: Template, state: Template, i, bound, time, h, filling):
        gap = self.walls.gap(s, state.position[i], self.radius[i], time)
        speed = bound + self.walls.velocity(s, state.position[i], time).norm()
        if gap <= h * speed and self.inverse_mass[i].max() > 0.0:
            if filling > 0:
                n = self.walls.normal(s, state.position[i], time)
                self._set(self.start[i] + self.filled[i], i, -1 - s, n, gap, filling)
            self.filled[i] = self.filled[i] + 1

    @ti.func
    def _set(self, c, i, other, normal, gap, filling):
        """Write an entry; `filling` 2 begins with its impulse in the last drift."""
        impulse = ti.cast(0.0, float)
        if filling == 2:
            for old in range(self.old_start[i], self.old_start[i + 1]):
                if self.old_other[old] == other:
                    impulse = self.old_impulse[old]
        self.other[c] = other
        self.normal[c] = normal
        self.gap[c] = gap
        self.impulse[c] = impulse
        self.given[c] = 0.0
        self.impact[c] = 0

    # Access to an entry

    @ti.func
    def restitution_of(self, i, c):
        """Restitution of entry c of row i."""
        e = ti.cast(1.0, float)
        j = self.other[c]
        if j >= 0:
            e = self.restitution[self.material[i], self.material[j]]
        for s in ti.static(range(self.walls.plain_count)):
            if j == -1 - s:
                e = self.walls.restitution(s)
        if ti.static(self.walls.segment_count > 0):
            if j < -self.walls.plain_count:
                e = self.walls.restitution(-1 - j)
        return e

    @ti.func
    def smaller_radius(self, i, c):
        """The radius of the smaller sphere of entry c of row i [length]."""
        result = self.radius[i]
        if self.other[c] >= 0:
            result = ti.min(result, self.radius[self.other[c]])
        return result

    @ti.func
    def velocity_of_other(self, velocity: Template, c):
        """Velocity of the other sphere or the surface of entry c; walls with a motion are not beside this solver."""
        j = self.other[c]
        result = velocity[ti.max(j, 0)]
        for s in ti.static(range(self.walls.plain_count)):
            if j == -1 - s:
                result = self.walls.velocity(s, result, 0.0)
        if ti.static(self.walls.segment_count > 0):
            if j < -self.walls.plain_count:
                result = self.walls.velocity(-1 - j, result, 0.0)
        return result

    @ti.func
    def find_impact(self, state: Template, separation, i, c, time, h, resting_speed):
        """Mark entry c as an impact if it is hit within h at more than `resting_speed`; turn its normal to that instant."""
        j = self.other[c]
        x, v = state.position[i], state.velocity[i]
        u = self.velocity_of_other(state.velocity, c) - v  # of the other, seen from i
        limit = 0.0 if self.restitution_of(i, c) == 1.0 else resting_speed
        when = ti.cast(ti.math.inf, float)
        # The horizon is a little longer than h: an impact that round-off puts just behind the drift would in part be treated as
        # a resting contact. It depends on the sum of both places, so that it is the same for both rows of a pair.
        size = x.norm() + state.position[j if j >= 0 else i].norm()
        horizon = h + ti.static(ROUNDINGS * self.epsilon) * size / u.norm()
        n = self.normal[c]
        if j >= 0:
            reach = self.radius[i] + self.radius[j]
            when = first_contact_curved(separation, u, reach, False, horizon)
            if when <= horizon:
                place = separation + when * u
                n = place * (-1.0 / place.norm())
        for s in ti.static(range(self.walls.plain_count)):
            if j == -1 - s:
                when = self.walls.time_of_contact(s, x, v, self.radius[i], time, horizon)
                if when <= horizon:
                    n = self.walls.normal(s, x + when * v, time + when)
        if ti.static(self.walls.segment_count > 0):
            if j < -self.walls.plain_count:
                when = self.walls.time_of_contact(-1 - j, x, v, self.radius[i], time, horizon)
                if when <= horizon and self.walls.stands_back(-1 - j, x, self.radius[i], time, v, when, horizon):
                    when = ti.cast(ti.math.inf, float)
                if when <= horizon:
                    n = self.walls.normal(-1 - j, x + when * v, time + when)
        if when <= horizon and n.dot(u) > limit:
            when = ti.min(when, h)
            self.impact[c] = 1
            self.when[c] = when
            self.normal[c] = n
            if when > 0.0:
                self.gap[c] = when * n.dot(u)
        elif ti.static(self.walls.segment_count > 0):
            if j < -self.walls.plain_count:
                self.gap[c], self.normal[c] = self.walls.support(-1 - j, x, self.radius[i], time)
