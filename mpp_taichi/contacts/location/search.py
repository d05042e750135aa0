"""The first contact within a step of an adaptive method: none is missed, however fast the spheres are."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts.location.paths import StepPaths
from mpp_taichi.contacts.shared.bounce import Bounce
from mpp_taichi.contacts.shared.contact_counts import Tally
from mpp_taichi.types import Template

MOST_WAITS = 100_000  # of one pair in one step; a grazing contact takes some tens


@ti.data_oriented
class StepSearch:
    """Conservative advancement of every pair, and of every sphere and wall, along the polynomials of a step.

    During a wait no contact is possible, by bounds that hold over the whole step (`StepPaths.least_wait`); after it the gap is
    computed again. The gap of two spheres cannot bend towards contact by more than their accelerations differ, as the turning
    of the line between them only opens the gap. Inside a curved wall this turning closes the gap, so that there the squared
    distance is followed. A contact is a gap that has closed, but for rounding, and goes on closing.
    Source: Mirtich, Impulse-based Dynamic Simulation of Rigid Body Systems, PhD thesis, UC Berkeley (1996).
    """

    def __init__(self, bounce: Bounce, paths: StepPaths, tally: Tally, state: Any) -> None:
        """Bind the parts."""
        self.bounce, self.paths, self.tally, self.state = bounce, paths, tally, state
        self.walls = bounce.walls
        self.count = paths.count

    @ti.func
    def first_contact(self):
        """The share of the step at which the first contact happens; infinity if there is none."""
        first = ti.math.inf
        for i in range(self.count):
            for j in range(i + 1, self.count):
                reach = self.bounce.radius[i] + self.bounce.radius[j]
                movable = (self.bounce.inverse_mass[i] + self.bounce.inverse_mass[j]).max() > 0.0
                if reach > 0.0 and movable:
                    first = ti.min(first, self._pair_contact(i, j, reach, ti.min(first, 1.0)))
            if self.bounce.inverse_mass[i].max() > 0.0:
                for s in ti.static(range(self.walls.plain_count)):
                    first = ti.min(first, self._wall_contact(s, i, ti.min(first, 1.0)))
                if ti.static(self.walls.segment_count > 0):
                    for g in range(self.walls.segment_count):
                        first = ti.min(first, self._wall_contact(self.walls.plain_count + g, i, ti.min(first, 1.0)))
        return first

    @ti.func
    def _pair_contact(self, i, j, reach, horizon):
        """The share at which i and j touch, up to `horizon`, or infinity."""
        result = ti.math.inf
        way = self.state.way[i] + self.state.way[j]
        slowest = self.paths.rounding * way
        near = (self.paths.coefficient[j] - self.paths.coefficient[i]).norm() - reach
        s, waits, going = 0.0, 0, False
        bend = 0.0
        if not near > way * horizon + self.paths.blur(i, 0.0) + self.paths.blur(j, 0.0):
            bend = self.paths.bend_between(i, j)
            going = True
        while going:
            x_i, v_i = self.paths.place(i, s)
            x_j, v_j = self.paths.place(j, s)
            separation = x_j - x_i
            distance = separation.norm()
            gap = distance - reach
            rate = separation.dot(v_j - v_i) / ti.max(distance, self.paths.epsilon * reach)
            blur = self.paths.blur(i, s) + self.paths.blur(j, s) + self.paths.rounding * reach
            if gap <= blur and rate < -slowest:
                result = ti.min(s + self.paths.last_wait(gap, rate, bend), horizon)
                going = False
            else:
                s += self.paths.least_wait(gap, rate, bend, blur, slowest, s)
                waits += 1
                going = self._goes_on(s, waits, horizon)
        return result

    @ti.func
    def _wall_contact(self, k: Template, i, horizon):
        """The share at which sphere i touches surface k, up to `horizon`, or infinity."""
        result = ti.math.inf
        begin, length = self.state.clock[0], self.state.clock[1]
        radius, h = self.bounce.radius[i], ti.cast(length, float)
        x, v = self.paths.place(i, 0.0)
        w = h * self.walls.velocity(k, x, 0.0)
        way = self.state.way[i] + w.norm()
        slowest = self.paths.rounding * way
        is_plane = ti.static(self.walls.is_plane(k))
        is_bowl = ti.static(self.walls.is_bowl(k))
        inner, bend = 0.0, 0.0
        if ti.static(is_plane):
            bend = self.paths.bend_along(i, self.walls.normal(k, x, 0.0))
        else:
            bend = self.paths.bend(i)
        if ti.static(is_bowl):
            inner = self.walls.surfaces[k].radius - radius
            bend = 2.0 * (way * way + inner * bend)
        s, waits, going = 0.0, 0, True
        while going:
            x, v = self.paths.place(i, s)
            now = ti.cast(begin + s * length, float)
            gap = self.walls.gap(k, x, radius, now)
            rate = self.walls.normal(k, x, now).dot(v - w)
            blur = self.paths.wall_blur(self.walls, k, i, s, now)
            touches, least = gap <= blur, slowest
            if ti.static(is_bowl):
                # gap (2 inner − gap) = inner² − (squared distance from the axis), which is smooth on the axis as well.
                rate *= 2.0 * (inner - gap)
                gap *= 2.0 * inner - gap
                blur, least = inner * blur, 2.0 * inner * slowest
            if touches and rate < -least:
                result = ti.min(s + self.paths.last_wait(gap, rate, bend), horizon)
                going = False
            else:
                s += self.paths.least_wait(gap, rate, bend, blur, least, s)
                waits += 1
                going = self._goes_on(s, waits, horizon)
        return result

    @ti.func
    def _goes_on(self, s, waits, horizon):
        """Whether the search goes on at s; a search with too many waits is given up, and an s that is NaN ends it."""
        result = s <= horizon
        if result and waits >= MOST_WAITS:
            self.tally.give_up(0, 1)
            result = False
        return result
