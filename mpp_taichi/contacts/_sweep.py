"""Drift with exact contacts: straight flights, and every contact on the way at its time and in its order.

Spheres whose predicted contacts lie within the drift form islands; an island is played through event by event, and
islands in parallel. Where a sphere leaves a contact towards a sphere outside, the two islands are joined and played
again from the start of the drift, until nothing joins: the result is that of one queue of all events, to round-off.
Few spheres are one island from the beginning. Nothing depends on the number of threads.
"""

import taichi as ti

from mpp_taichi.contacts._flight import Piece
from mpp_taichi.contacts._island_play import IslandPlay
from mpp_taichi.contacts._tally import CHUNKS
from mpp_taichi.quick_compilation import quick_compilation
from mpp_taichi.serial_loops import loop_grain
from mpp_taichi.types import Template

TRIES = 64  # with wider margins, then with shorter pieces


@ti.data_oriented
class Sweep(IslandPlay):
    """The spheres of a state, moved along their velocities from contact to contact; `resolve` may be overridden.

    plays_in_turn   islands one after the other, for a `resolve` that has memory for one only
    """

    plays_in_turn = False

    def forget(self) -> None:
        """Forget the partners that were written down: a report is summed in their order, though no motion depends on it."""
        self.is_listed = False

    # A drift -----------------------------------------------------------------------------------------------------------

    def drift(self, time: float, h: float) -> None:
        """Move all spheres by h along their velocities, contacts resolved on the way."""
        with quick_compilation():  # a third of the time, for a kernel as fast
            if self.all_pairs:
                self._drift_serial(time, h)
            else:
                done = 0.0
                while done < h:
                    done += self._drift_piece(time + done, h - done)

    @ti.kernel
    def _drift_serial(self, time: float, h: float):
        ti.loop_config(serialize=self.watch.on_cpu)
        for _ in range(1):
            self.drift_serial(time, h)
            if self.watch.was_stopped():
                self.tally.give_up(0, 1)

    @ti.func
    def drift_serial(self, time, h):
        """The same inside a serialized loop of another kernel, where `all_pairs` is true."""
        self.islands.everything()
        for i in range(self.particle_count):
            wall = self._first_wall(i, time, h)
            self.islands.first_time[i] = wall[0]
            self.islands.first_partner[i] = ti.cast(wall[1], ti.i32)
        for i in range(self.particle_count):
            for j in range(i + 1, self.particle_count):
                self._offer_first(i, j, h)
        self._play(0, time, h)
        for i in range(self.particle_count):
            self._keep(0, i, h)

    @ti.func
    def _offer_first(self, i, j, h):
        """Note the first contact of a pair from the state at the start."""
        separation = self.bounce.separation(self.start_of(i), self.start_of(j))
        self._see_overlap(i, j, separation)
        if ti.static(not self.looks_again):
            t = self._time_of_contact(i, j, separation, self.start_velocity_of(i), self.start_velocity_of(j), h)
            if t < self.islands.first_time[i]:
                self.islands.first_time[i] = t
                self.islands.first_partner[i] = j
            if t < self.islands.first_time[j]:
                self.islands.first_time[j] = t
                self.islands.first_partner[j] = i

    def _drift_piece(self, time: float, rest: float) -> float:
        """A piece of a drift of many spheres; returns how long it was."""
        piece = self.flight.plan(rest)
        for _ in range(TRIES):
            self._look_around(piece)
            links = self._search(time, piece.h, self.is_listed)
            if links > self.islands.capacity or self.flight.is_crowded(piece, links):
                piece = self.flight.shorten(piece)
            elif self._play_until_nothing_joins(time, piece.h) == 0:
                break
            else:
                piece = self._again(piece)
        else:
            self._give_up()
        self._commit(piece.h)
        return piece.h

    def _again(self, piece: Piece) -> Piece:
        """What is to be tried after a sphere left its margin."""
        return self.flight.widen(piece)

    def _play_until_nothing_joins(self, time: float, h: float) -> int:
        """Number of spheres that left the margin within which their partners were looked for."""
        while True:
            joins, violations = self._play_islands(time, h, self.is_listed)
            if joins == 0 or violations > 0:
                return violations

    @ti.kernel
    def _give_up(self):
        self.tally.give_up(0, ti.max(self.violations[0], 1))

    # Looking for first contacts ----------------------------------------------------------------------------------------

    def _look_around(self, piece: Piece) -> None:
        """Take positions and velocities over into the slots, and sort the spheres anew if some went beyond the skin."""
        if not self.is_listed or self._take_over() > 0:
            skin = 0.0 if self.plays_in_turn else piece.skin
            self.grid.build(self.state.position, self.flight.reach, piece.bounds, skin)
            self.is_listed = skin > 0.0 and self.partners.write()
            self._take_over()

    @ti.kernel
    def _take_over(self) -> ti.i32:
        """Returns whether the grid may miss a pair: whether there is a sphere whose reach now leads out of that then."""
        self.stale[0] = 0
        for k in range(self.particle_count):
            i = self.grid.order[k]
            x, reach = self.state.position[i], self.flight.reach[i]
            self.start_position[k] = x
            self.start_velocity[k] = self.state.velocity[i]
            self.start_radius[k] = self.bounce.radius[i]
            self.start_reach[k] = reach
            self.islands.parent[k] = -1
            self.islands.island[k] = -1
            skin = self.grid.sorted_reach[k] - reach
            if not (skin > 0.0 and self.bounce.separation(self.grid.sorted_position[k], x).norm_sqr() <= skin * skin):
                self.stale[0] = 1
        return self.stale[0]

    @ti.kernel
    def _search(self, time: float, h: float, listed: Template) -> ti.i32:
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.islands.count[self.islands.LINKS] = 0
            self.islands.count[self.islands.PENDING] = 0
            self.violations[0] = 0
        for k in range(self.particle_count):
            if ti.static(listed):
                self.partners.visit_later(k, self._see_pair, time, h)
            else:
                self.grid.visit_later(k, self._see_pair, time, h)
            wall = self._first_wall(k, time, h)
            if wall[0] <= h:
                self.islands.link(k, ti.cast(wall[1], ti.i32), wall[0])
        return self.islands.count[self.islands.LINKS]

    @ti.func
    def _see_pair(self, k, other, time, h):
        separation = self.bounce.separation(self.start_position[k], self.start_position[other])
        self._see_overlap(k, other, separation)
        t = self._time_of_contact(k, other, separation, self.start_velocity[k], self.start_velocity[other], h)
        if t <= h:
            self.islands.link(k, other, t)

    # Playing islands ---------------------------------------------------------------------------------------------------

    @ti.kernel
    def _play_islands(self, time: float, h: float, listed: Template) -> ti.types.vector(2, ti.i32):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.islands.form()
        ti.loop_config(serialize=self.plays_in_turn)
        for k in range(self.islands.count[self.islands.PENDING]):
            self._play(self.islands.pending[k], time, h)
        for k in range(self.islands.count[self.islands.INVOLVED]):
            i = self.islands.involved[k]
            if self.near[i] == 1:
                self.visit(i, self._see_other_island, h, h)
        return ti.Vector([self.islands.count[self.islands.LINKS], self.violations[0]])

    @ti.func
    def _see_other_island(self, k, other, h, _):
        """Join two islands where spheres may have met: neither left a ball around its start, and the balls meet."""
        if self.islands.island[other] >= 0 and self.islands.island[other] != self.islands.island[k]:
            separation = self.bounce.separation(self.start_position[k], self.start_position[other])
            reach = self.radius_of(k) + self.radius_of(other) + self.excursion[k] + self.excursion[other]
            if separation.dot(separation) <= reach * reach:
                self.join(k, other)

    # Making it so ------------------------------------------------------------------------------------------------------

    @ti.kernel
    def _commit(self, h: float):
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if q % grain == 0:
                chunk = q // grain
                for k in range(self.tally.begin_of(chunk), self.tally.begin_of(chunk + 1)):
                    if self.islands.island[k] >= 0:
                        self._keep(chunk, k, h)
                    else:
                        self._fly_on(k, h)

    @ti.func
    def _fly_on(self, k, h):
        i = self.index(k)
        self.state.position[i] = self.start_position[k] + self.start_velocity[k] * h
        if ti.static(self.keeps_last_contact):
            self.last_contact[i] = self.last_contact[i] - h
