"""A drift in which spheres merge where they meet, and bounce off walls: one after the other, in the order of time."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.particle_update import drifted
from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.contacts.mergers.merge_events import Agenda
from mpp_taichi.contacts.mergers.merger import Merger
from mpp_taichi.contacts.shared.impulse import impulse_between, pushed
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.types import Template
from mpp_taichi.walls._surfaces import WallSurfaces

ALL_PAIRS_UP_TO = 800  # spheres; on two cores both ways take as long at some 900
EVENTS_PER_SPHERE, SPARE_EVENTS = 8, 64  # entries for which the agenda has room; a drift with more is cut into pieces
ROOM = 1.001  # reach over the way of a sphere, for rounding
TRIES = 64  # halvings of a piece with too many events
SLOWEST = 4.0  # roundings of the velocities; a slower approach to a wall is round-off


@ti.data_oriented
class MergingDrift:
    """Straight flights, and an agenda of their contacts: meetings (time, i, j), i < j, and walls (time, i, −1 − surface).

    The earliest entry is resolved. Then the entries of the spheres that it has changed are removed, and the next contacts of
    the outcome are entered. At the time t of the drift a sphere is at state.position + state.velocity · t, whether it has
    changed or not, so that no other sphere has to be moved before the end.

    Meetings are searched among all pairs, or on the cell grid with |x_j − x_i| ≤ r_i + r_j + (|v_i − v| + |v_j − v|) h,
    v the mean velocity: no meeting is missed, and the agenda is the same. If it has no more room, a piece of the drift
    ends at the last event, and another piece begins.
    """

    def __init__(
        self,
        setup: ContactSetup,
        state: Any,
        forces: Any,
        *,
        bounce_limit: int,
        log_capacity: int,
    ) -> None:
        """Allocate for the spheres of `state`."""
        self._before = ContactReport()
        n = setup.particle_count
        self.particle_count, self.state = n, state
        self.walls = WallSurfaces(setup.enclosure)
        self.bounce_limit = bounce_limit
        self.all_pairs = n <= ALL_PAIRS_UP_TO
        self.merger = Merger(setup, state, forces, log_capacity=log_capacity)
        self.tally, self.log = self.merger.tally, self.merger.log
        self.grid = None if self.all_pairs else CellGrid(n, setup.dimensions)
        self.slowest = SLOWEST * float(np.finfo(np.float32 if state.position.dtype == ti.f32 else np.float64).eps)
        self.reach = ti.field(float)
        self.there, self.left = (
            ti.field(ti.i32),
            ti.field(ti.i32),
        )  # the spheres that have not merged into another, and their number
        builder = ti.FieldsBuilder()
        self.agenda = Agenda(EVENTS_PER_SPHERE * n + SPARE_EVENTS, builder)
        for field in (self.reach, self.there):
            builder.dense(ti.i, n).place(field)
        builder.place(self.left)
        self._tree = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.merger, self.walls, self._tree, self.grid):
            if part is not None:
                part.destroy()

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        report = self.tally.collect()
        now = ContactReport(potential_change=float(self.merger.potential_change[0]), merge_count=report.pair_count)
        since, self._before = now.sums_since(self._before), now
        return report + since

    def drift(self, time: float, h: float) -> None:
        """Move all spheres by h along their velocities; spheres that meet on the way merge."""
        h = self.state.rounded(h)  # as kernels round it, so that the lengths of the pieces add up to it
        with quick_compilation():
            if self.all_pairs:
                done = self._drift_serial(time, h)
            else:
                done = self._drift_piece(time, h)
            while done < h:
                self.log.empty()
                done += self._drift_piece(time + done, h - done)

    @ti.kernel
    def _drift_serial(self, time: float, h: float) -> float:
        """Search all pairs, play and move in one launch; returns the time that was played, 0 if the agenda had no room."""
        done = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            self._begin_search(h)
            self._see_all(time, h)
            if not self.agenda.is_too_short():
                done = self._play(time, h)
                self._move(done)
        return done

    def _drift_piece(self, time: float, rest: float) -> float:
        """Do a piece of a drift; returns its length."""
        h = rest
        for _ in range(TRIES):
            self._prepare_search(h)
            if self.all_pairs:
                self._search_all(time, h)
            else:
                self.grid.build(self.state.position, self.reach)
                self._search(time, h)
            if self.agenda.count[None] <= self.agenda.capacity:
                break
            h /= 2.0
        else:
            self.tally.unresolved[0] += 1  # this ends the run, but the drift has to end too
            self.agenda.count[None] = 0
            h = rest
        return float(self._play_and_move(time, h))

    # Search for contacts

    @ti.kernel
    def _prepare_search(self, h: float):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self._begin_search(h)

    @ti.func
    def _begin_search(self, h):
        """Set the reach of each sphere: its radius, and its way relative to the mean motion.

        A sphere that has merged into another gets the least reach, for which the grid costs least.
        """
        left = 0
        common = ti.Vector.zero(float, self.merger.dimensions)
        for i in range(self.particle_count):
            if self.merger.is_there(i):
                common += self.state.velocity[i]
                self.there[left] = i
                left += 1
        common /= ti.max(left, 1)
        least = ti.math.inf
        for k in range(left):
            i = self.there[k]
            self.reach[i] = self.state.radius[i] + ROOM * (self.state.velocity[i] - common).norm() * h
            least = ti.min(least, self.reach[i])
        self.left[None] = left
        self.agenda.clear()
        for i in range(self.particle_count):
            if not self.merger.is_there(i):
                self.reach[i] = least

    @ti.kernel
    def _search_all(self, time: float, h: float):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self._see_all(time, h)

    @ti.func
    def _see_all(self, time, h):
        for a in range(self.left[None]):
            i = self.there[a]
            for b in range(a + 1, self.left[None]):
                self._see(i, self.there[b], h)
            self._see_walls(i, time, 0.0, h)

    @ti.kernel
    def _search(self, time: float, h: float):
        for slot in range(self.particle_count):
            i = self.grid.order[slot]
            if self.merger.is_there(i):
                self.grid.visit_later(slot, self._see_slots, h, h)
                self._see_walls(i, time, 0.0, h)

    @ti.func
    def _see_slots(self, slot, other, h, _):
        one, two = self.grid.order[slot], self.grid.order[other]
        if self.merger.is_there(two):
            self._see(ti.min(one, two), ti.max(one, two), h)

    @ti.func
    def _see(self, i, j, h):
        """List the meeting of i and j, i < j, from the start of the drift on."""
        separation = self.state.position[j] - self.state.position[i]
        reach = self.reach[i] + self.reach[j]
        if separation.dot(separation) <= reach * reach:
            t = self.merger.time_of_meeting(i, j, 0.0, h)
            if t <= h:
                self.agenda.add(t, i, j)

    @ti.func
    def _see_walls(self, i, time, now, h):
        """List the next contact of i with each surface, from `now` on."""
        if ti.static(len(self.walls.surfaces) > 0):
            if self.state.free[i].max() > 0.0:
                for s in ti.static(range(self.walls.plain_count)):
                    self._see_wall(s, i, time, now, h)
                if ti.static(self.walls.segment_count > 0):
                    for g in range(self.walls.segment_count):
                        self._see_wall(self.walls.plain_count + g, i, time, now, h)

    @ti.func
    def _see_wall(self, s: Template, i, time, now, h):
        x, v, radius = self.merger.place(i, now), self.state.velocity[i], self.state.radius[i]
        t = self.walls.time_of_contact(s, x, v, radius, time + now, h - now)
        if t == 0.0:
            # An approach of a touching sphere that is round-off counts as none: the sphere lies on the wall.
            w = self.walls.velocity(s, x, time + now)
            n = self.walls.normal(s, x, time + now)
            if -n.dot(v - w) <= self.slowest * (v.norm() + w.norm()):
                t = ti.math.inf
        if now + t <= h:
            self.agenda.add(now + t, i, -1 - s)

    # Resolution of contacts

    @ti.kernel
    def _play_and_move(self, time: float, h: float) -> float:
        done = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            done = self._play(time, h)
        for i in range(self.particle_count):
            self.state.position[i] = drifted(self.state.position[i], self.state.velocity[i], done)
        return done

    @ti.func
    def _move(self, h):
        for i in range(self.particle_count):
            self.state.position[i] = drifted(self.state.position[i], self.state.velocity[i], h)

    @ti.func
    def _play(self, time, h):
        """Resolve all entries and the contacts that follow; returns h, or the time of the last event if room ran out."""
        now, bounces = 0.0, 0
        running = True
        while running:
            k = self.agenda.earliest()
            if k < 0:
                now = h
                running = False
            elif self.log.is_full() or self.agenda.is_too_short():
                running = False
            else:
                now = self.agenda.time[k]
                i, j = self.agenda.i[k], self.agenda.j[k]
                changed = i
                if j >= 0:
                    changed = self.merger.merge(i, j, time, now)
                else:
                    self._bounce(i, -1 - j, time, now)
                    bounces += 1
                self.agenda.take_off(i, j)
                if bounces > self.bounce_limit:
                    self.tally.give_up(i, 1)
                    self.agenda.clear()
                else:
                    self._look_ahead(changed, time, now, h)
        return now

    @ti.func
    def _look_ahead(self, i, time, now, h):
        """List the contacts of sphere i from `now` on."""
        for j in range(self.particle_count):
            if j != i and self.merger.is_there(j):
                first, second = ti.min(i, j), ti.max(i, j)
                t = self.merger.time_of_meeting(first, second, now, h)
                if t <= h:
                    self.agenda.add(t, first, second)
        self._see_walls(i, time, now, h)

    @ti.func
    def _bounce(self, i, surface, time, t):
        """Let sphere i bounce off a surface, with its inverse masses w = free / mass along the axes."""
        x, v = self.merger.place(i, t), self.state.velocity[i]
        _, n, surface_velocity, e, account = self.walls.touched(surface, x, self.state.radius[i], time + t)
        w = self.state.free[i] / self.state.mass[i]
        if (n * n).dot(w) > 0.0:
            impulse = impulse_between(n, v, surface_velocity, w, ti.Vector.zero(float, n.n), e)
            after = pushed(v, w, n, impulse[0], impulse[1], 1)
            self.state.velocity[i] = after
            self.state.position[i] = x - after * t
            self.tally.begin(i)
            self.tally.add_wall(i, account, impulse[0], impulse[2], 0, 0.0)
            self.tally.keep(0, i)
            self.log.note(time + t, i, -1 - surface, ti.abs(impulse[0]))
