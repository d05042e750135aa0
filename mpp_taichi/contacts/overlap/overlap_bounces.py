"""Bounces of two spheres that overlap, and of a sphere that reaches through a surface."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.particle_update import drifted
from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.shared.bounce import Bounce
from mpp_taichi.contacts.shared.contact_counts import Tally
from mpp_taichi.contacts.shared.restitution import restitution_at
from mpp_taichi.contacts.shared.wall_friction import rubbed, work_of_wall
from mpp_taichi.types import Template

LONG_AGO = -1e30  # last contact of a sphere that has had none


@ti.data_oriented
class OverlapBounces:
    """A pair that overlaps by δ is moved apart by δ along n from i to j, each sphere by its share of the inverse mass:

        Δx_i = −δ w_i n / Σ_k n_k² (w_ik + w_jk),   Δx_j = +δ w_j n / Σ_k n_k² (w_ik + w_jk)

    and gets the impulse of `Bounce` if it approaches. Spheres that reach through a surface are put back onto it and reflected.
    Counts are kept in the totals of a `chunk` of spheres.
    """

    def __init__(self, setup: ContactSetup, state: Any, *, apart: bool) -> None:
        """Allocate for the spheres of `setup`, whose fields `state` has; `apart`: each sphere has totals of its own."""
        n = self.particle_count = setup.particle_count
        self.state = state
        self.contact_time = float(setup.contact_time)
        self.bounce = Bounce(setup)
        self.walls = self.bounce.walls
        self.tally = Tally(n, self.walls.account_count, getattr(state, "wide", ti.f64), apart=apart, works=self.walls.works)
        self.last_contact = ti.field(float)
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, n if self.contact_time > 0.0 else 1).place(self.last_contact)
        self._tree = builder.finalize()
        self.last_contact.fill(LONG_AGO)

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.bounce, self.tally, self._tree):
            part.destroy()

    @ti.kernel
    def move(self, h: float):
        """Move all spheres by h along their velocities."""
        for i in range(self.particle_count):
            self.state.position[i] = drifted(self.state.position[i], self.state.velocity[i], h)

    @ti.func
    def do_overlap(self, i, j):
        """Whether spheres i and j overlap."""
        separation = self.bounce.separation(self.state.position[i], self.state.position[j])
        reach = self.bounce.radius[i] + self.bounce.radius[j]
        return separation.dot(separation) < reach * reach

    @ti.func
    def bounce_pair(self, chunk, i, j, time):
        """Let spheres i and j bounce and push them apart, if they overlap at `time`."""
        separation = self.bounce.separation(self.state.position[i], self.state.position[j])
        distance = separation.norm()
        reach = self.bounce.radius[i] + self.bounce.radius[j]
        overlap = reach - distance
        if overlap > 0.0:
            self.tally.see_overlap(i, overlap / ti.min(self.bounce.radius[i], self.bounce.radius[j]))
            n = ti.Vector.unit(self.bounce.dimensions, 0, float)  # the x axis, where the centres coincide and have no direction
            if distance > 0.0:
                n = separation / distance
            w_i, w_j = self.bounce.inverse_mass[i], self.bounce.inverse_mass[j]
            v_i, v_j = self.state.velocity[i], self.state.velocity[j]
            if n.dot(v_j - v_i) < 0.0:
                nominal = self.bounce.restitution_of(i, j)
                e, elastic = restitution_at(time, nominal, i, j, self.last_contact, self.contact_time)
                result = self.bounce.pair_impulse(i, j, n, v_i, v_j, e)
                self.state.velocity[i] = self.bounce.after(i, v_i, n, result, -1)
                self.state.velocity[j] = self.bounce.after(j, v_j, n, result, 1)
                self.tally.begin(i)
                self.tally.add_pair(i, result[0], distance, result[2], elastic)
                self.tally.keep(chunk, i)
            yielding = (n * n).dot(w_i + w_j)
            if yielding > 0.0:
                self.state.position[i] = self.state.position[i] - (overlap / yielding) * (w_i * n)
                self.state.position[j] = self.state.position[j] + (overlap / yielding) * (w_j * n)

    @ti.func
    def bounce_off_walls(self, chunk, i, time):
        """Let sphere i bounce off each surface that it reaches through at `time`, and put it back."""
        # Most spheres touch no wall: the least gap of all walls is computed without a branch for each wall.
        place, radius = self.state.position[i], self.bounce.radius[i]
        least = ti.cast(0.0, float)
        for s in ti.static(range(self.walls.plain_count)):
            least = ti.min(least, self.walls.gap(s, place, radius, time))
        if ti.static(self.walls.segment_count > 0):
            for g in range(self.walls.segment_count):
                least = ti.min(least, self.walls.gap(self.walls.plain_count + g, place, radius, time))
        if least < 0.0:
            self._bounce_off_each_wall(chunk, i, time)

    @ti.func
    def _bounce_off_each_wall(self, chunk, i, time):
        for s in ti.static(range(self.walls.plain_count)):
            self._bounce_off_wall(s, chunk, i, time)
        if ti.static(self.walls.segment_count > 0):
            for g in range(self.walls.segment_count):
                self._bounce_off_wall(self.walls.plain_count + g, chunk, i, time)

    @ti.func
    def _bounce_off_wall(self, s: Template, chunk, i, time):
        x, radius = self.state.position[i], self.bounce.radius[i]
        gap, is_met = self.walls.gap(s, x, radius, time), False
        if gap < 0.0:
            is_met = self.walls.can_hold(s, x, radius, time)
        if is_met:
            if radius > 0.0:
                self.tally.see_overlap(i, -gap / radius)
            n = self.walls.normal(s, x, time)
            w = self.bounce.inverse_mass[i]
            v, surface_velocity = self.state.velocity[i], self.walls.velocity(s, x - (gap + radius) * n, time)
            yielding = (n * n).dot(w)
            if n.dot(v - surface_velocity) < 0.0 and yielding > 0.0:
                e, elastic = restitution_at(time, self.walls.restitution(s), i, i, self.last_contact, self.contact_time)
                result = self.bounce.wall_impulse(i, n, v, surface_velocity, e)
                after, lost, work = self.bounce.after(i, v, n, result, 1), result[2], ti.cast(0.0, float)
                if ti.static(self.walls.rubs):
                    after, taken = rubbed(self.walls, s, n, after, surface_velocity, w, result[0])
                    lost += taken
                if ti.static(self.walls.works):
                    work = work_of_wall(surface_velocity, v, after, w)
                self.state.velocity[i] = after
                self.tally.begin(i)
                self.tally.add_wall(i, self.walls.account(s), result[0], lost, elastic, work)
                self.tally.keep(chunk, i)
            if yielding > 0.0:
                self.state.position[i] = self.state.position[i] - (gap / yielding) * (w * n)
