"""First contacts of a piece: the time at which two spheres, or a sphere and a surface, meet if no other event comes before."""

import taichi as ti

from mpp_taichi.contacts.sweep.sweep_parts import SweepParts
from mpp_taichi.types import Template


@ti.data_oriented
class FirstContacts:
    """Times of contact of flights from the start of a piece; overlaps that the start has are noted on the way."""

    def __init__(self, parts: SweepParts) -> None:
        """Bind the parts."""
        self.slots, self.bounce, self.tally = parts.slots, parts.bounce, parts.tally
        self.walls = parts.bounce.walls

    @ti.func
    def separation(self, i, j):
        """The vector from the start of slot i to the nearest image of the start of slot j."""
        return self.bounce.separation(self.slots.start_of(i), self.slots.start_of(j))

    @ti.func
    def time_of_pair(self, i, j, separation, h):
        """When the spheres in slots i and j meet, 0 … h, or infinity."""
        v_i, v_j = self.slots.start_velocity_of(i), self.slots.start_velocity_of(j)
        return self.slots.time_of_contact(i, j, separation, v_i, v_j, h)

    @ti.func
    def see_overlap(self, i, j, separation):
        """Note by how much two spheres overlap, relative to the smaller radius, if they do."""
        reach = self.slots.radius_of(i) + self.slots.radius_of(j)
        square = separation.dot(separation)
        if square < reach * reach:
            smaller = ti.min(self.slots.radius_of(i), self.slots.radius_of(j))
            self.tally.see_overlap(i, (reach - ti.sqrt(square)) / smaller)

    @ti.func
    def first_wall(self, k, time, h):
        """Time of the first contact of slot k with a surface s, and −2 − s; (infinity, −1) if there is none within h."""
        result = ti.Vector([ti.math.inf, -1.0])
        for s in ti.static(range(self.walls.plain_count)):
            t = self._time_of_wall(s, k, time, h)
            if t < result[0]:
                result = ti.Vector([t, -2.0 - s])
        if ti.static(self.walls.segment_count > 0):
            for g in range(self.walls.segment_count):
                t = self._time_of_wall(self.walls.plain_count + g, k, time, h)
                if t < result[0]:
                    result = ti.Vector([t, -2.0 - (self.walls.plain_count + g)])
        return result

    @ti.func
    def _time_of_wall(self, s: Template, k, time, h):
        """When slot k meets surface s, 0 … h, or infinity; an overlap is noted."""
        x, radius = self.slots.start_of(k), self.slots.radius_of(k)
        t = self.bounce.time_of_wall(s, self.slots.index(k), radius, x, self.slots.start_velocity_of(k), time, h)
        gap = self.walls.gap(s, x, radius, time)
        if gap < 0.0 and radius > 0.0:
            self.tally.see_overlap(k, -gap / radius)
        return t
