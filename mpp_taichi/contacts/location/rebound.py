"""Bounces at the moment of a contact: every touching pair that approaches bounces, until no pair does."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts.location.paths import StepPaths
from mpp_taichi.contacts.shared.bounce import Bounce
from mpp_taichi.contacts.shared.contact_counts import Tally
from mpp_taichi.contacts.shared.restitution import restitution_at
from mpp_taichi.types import Template

TWICE = 2.0  # blurs up to which a gap counts as closed: here it is computed in another way than in the search


@ti.data_oriented
class Rebound:
    """Bounces at one time, by number, with the impulses of `Bounce`; state.last_contact is kept for the TC model."""

    def __init__(self, bounce: Bounce, paths: StepPaths, tally: Tally, state: Any) -> None:
        """Bind the parts."""
        self.bounce, self.paths, self.tally, self.state = bounce, paths, tally, state
        self.walls, self.count = bounce.walls, paths.count
        self.contact_time = bounce.contact_time

    @ti.func
    def bounce_all(self, time, limit):
        """Let all touching pairs of the state, which is at `time`, bounce until none approaches, or `limit` is exceeded.

        Returns the number of bounces.
        """
        s = ti.cast((time - self.state.clock[0]) / self.state.clock[1], float)
        bounces, going = 0, True
        while going:
            before = bounces
            for i in range(self.count):
                for j in range(i + 1, self.count):
                    bounces += self._bounce_pair(i, j, s, time)
                for k in ti.static(range(self.walls.plain_count)):
                    bounces += self._bounce_wall(k, i, s, time)
                if ti.static(self.walls.segment_count > 0):
                    for g in range(self.walls.segment_count):
                        bounces += self._bounce_wall(self.walls.plain_count + g, i, s, time)
            going = bounces > before and bounces <= limit
        return bounces

    @ti.func
    def _bounce_pair(self, i, j, s, time):
        """1 if i and j touch, approach and bounce, else 0."""
        result = 0
        reach = self.bounce.radius[i] + self.bounce.radius[j]
        separation = self.state.position[j] - self.state.position[i]
        distance = separation.norm()
        gap = distance - reach
        blur = self.paths.blur(i, s) + self.paths.blur(j, s) + self.paths.rounding * reach
        if distance > 0.0 and gap <= TWICE * blur:
            n = separation / distance
            v_i, v_j = self.state.velocity[i], self.state.velocity[j]
            if n.dot(v_j - v_i) < -self.bounce.slowest * (v_i.norm() + v_j.norm()):
                nominal = self.bounce.restitution_of(i, j)
                e, elastic = restitution_at(time, nominal, i, j, self.state.last_contact, self.contact_time)
                impulse = self.bounce.pair_impulse(i, j, n, v_i, v_j, e)
                if impulse[0] > 0.0:
                    self.state.velocity[i] = self.bounce.after(i, v_i, n, impulse, -1)
                    self.state.velocity[j] = self.bounce.after(j, v_j, n, impulse, 1)
                    self.tally.begin(i)
                    self.tally.add_pair(i, impulse[0], distance, impulse[2], elastic)
                    self.tally.keep(0, i)
                    self._see_overlap(-gap, ti.min(self.bounce.radius[i], self.bounce.radius[j]))
                    result = 1
        return result

    @ti.func
    def _bounce_wall(self, k: Template, i, s, time):
        """1 if i touches surface k, approaches and bounces, else 0."""
        result = 0
        x, v, now = self.state.position[i], self.state.velocity[i], ti.cast(time, float)
        w = self.walls.velocity(k, x, now)
        gap = self.walls.gap(k, x, self.bounce.radius[i], now)
        if gap <= TWICE * self.paths.wall_blur(self.walls, k, i, s, now):
            n = self.walls.normal(k, x, now)
            if n.dot(v - w) < -self.bounce.slowest * (v.norm() + w.norm()):
                e, elastic = restitution_at(time, self.walls.restitution(k), i, i, self.state.last_contact, self.contact_time)
                impulse = self.bounce.wall_impulse(i, n, v, w, e)
                if impulse[0] > 0.0:
                    self.state.velocity[i] = self.bounce.after(i, v, n, impulse, 1)
                    self.tally.begin(i)
                    self.tally.add_wall(i, self.walls.account(k), impulse[0], impulse[2], elastic, 0.0)
                    self.tally.keep(0, i)
                    self._see_overlap(-gap, self.bounce.radius[i])
                    result = 1
        return result

    @ti.func
    def _see_overlap(self, depth, radius):
        if depth > 0.0 and radius > 0.0:
            self.tally.see_overlap(0, depth / radius)
