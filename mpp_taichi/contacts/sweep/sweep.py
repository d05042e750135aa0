"""Drift with exact contacts: straight flights, and every contact on the way at its time and in its order.

Spheres whose predicted contacts lie within the drift form islands; an island is played through event by event, and
islands in parallel. Where a sphere leaves a contact towards a sphere outside, the two islands are joined and played
again from the start of the drift, until nothing joins: the result is that of one queue of all events, to round-off.
Few spheres are one island from the beginning. Nothing depends on the number of threads.
"""

import taichi as ti

from mpp_taichi.contacts.shared.contact_counts import CHUNKS
from mpp_taichi.contacts.sweep.drift_planning import Piece
from mpp_taichi.contacts.sweep.island_play import IslandPlay
from mpp_taichi.device.fast_taichi.prefetch import prefetch
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation
from mpp_taichi.device.fast_taichi.serial_loops import loop_grain
from mpp_taichi.types import Template

TOGETHER = 8  # islands whose memory is asked for at once
BLOCK = 16  # slots whose partners are
TRIES = 64  # with wider margins, then with shorter pieces


@ti.data_oriented
class Sweep(IslandPlay):
    """The spheres of a state, moved along their velocities from contact to contact; `resolve` may be overridden.

    `plays_in_turn` is for a `resolve` that has memory for one island only.
    """

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
        piece = self.flight.plan(rest, self._motion or self.flight.measure(self.state.position, self.state.velocity))
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
        if self.in_slots:
            self._stay(self.flight.motion(self._commit_slots(piece.h)))
        else:
            self._commit(piece.h)
        return piece.h

    def _again(self, piece: Piece) -> Piece:
        """What is to be tried after a sphere left its margin."""
        return self.flight.widen(piece)

    def _play_until_nothing_joins(self, time: float, h: float) -> int:
        """Number of spheres that left the margin within which their partners were looked for."""
        joins, violations = self._play_islands(time, h, self.is_listed, 1)
        while joins > 0 and violations == 0:
            joins, violations = self._play_islands(time, h, self.is_listed, 0)
        return violations

    @ti.kernel
    def _give_up(self):
        self.tally.give_up(0, ti.max(self.violations[0], 1))

    # Looking for first contacts ----------------------------------------------------------------------------------------

    @ti.kernel
    def _search(self, time: float, h: float, listed: Template) -> ti.i32:
        for k in range(self.islands.count[self.islands.INVOLVED]):
            self.islands.leave(self.islands.involved[k])
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.islands.count[self.islands.LINKS] = 0
            self.islands.count[self.islands.INVOLVED] = 0
            self.islands.count[self.islands.PENDING] = 0
            self.violations[0] = 0
        if ti.static(listed):
            grain = ti.static(loop_grain())
            for q in range(CHUNKS * grain):
                if q % grain == 0:
                    begin, end = self.tally.begin_of(q // grain), self.tally.begin_of(q // grain + 1)
                    for k in range(begin, end):
                        if (k - begin) % BLOCK == 0:
                            self._fetch_partners(ti.min(k + BLOCK, end), ti.min(k + 2 * BLOCK, end))
                        self.partners.visit_later(k, self._see_pair, time, h)
                        self._see_walls(k, time, h)
        else:
            for k in range(self.particle_count):
                self.grid.visit_later(k, self._see_pair, time, h)
                self._see_walls(k, time, h)
        return self.islands.count[self.islands.LINKS]

    @ti.func
    def _see_walls(self, k, time, h):
        wall = self._first_wall(k, time, h)
        if wall[0] <= h:
            self.islands.link(k, ti.cast(wall[1], ti.i32), wall[0])

    @ti.func
    def _fetch_partners(self, first, end):
        """Have fetched where the later partners of some slots are, so that the memory is not waited for one by one."""
        if first < end:
            for p in range(self.partners.begin[first], self.partners.middle[end - 1]):
                prefetch(self.start_position, self.partners.partner[p])

    @ti.func
    def _see_pair(self, k, other, time, h):
        separation = self.bounce.separation(self.start_position[k], self.start_position[other])
        self._see_overlap(k, other, separation)
        t = self._time_of_contact(k, other, separation, self.start_velocity[k], self.start_velocity[other], h)
        if t <= h:
            self.islands.link(k, other, t)

    # Playing islands ---------------------------------------------------------------------------------------------------

    @ti.kernel
    def _play_islands(self, time: float, h: float, listed: Template, is_first: ti.i32) -> ti.types.vector(2, ti.i32):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.islands.form()
        if ti.static(self.plays_in_turn or not listed):
            ti.loop_config(serialize=self.plays_in_turn)
            for k in range(self.islands.count[self.islands.PENDING]):
                self._play(self.islands.pending[k], time, h)
        else:
            grain = ti.static(loop_grain())
            for q in range((self.islands.count[self.islands.PENDING] + TOGETHER - 1) // TOGETHER * grain):
                if q % grain == 0:
                    first = q // grain * TOGETHER
                    end = ti.min(first + TOGETHER, self.islands.count[self.islands.PENDING])
                    self._fetch_ahead(first, end)
                    for k in range(first, end):
                        self._play(self.islands.pending[k], time, h)
        for p in range(self.islands.count[self.islands.MEMBERS]):
            i = self.islands.members[p]
            if is_first == 0 or self.near[i] == 1:  # between islands that were not played again nothing has changed
                self.visit(i, self._see_other_island, h, h)
        return ti.Vector([self.islands.count[self.islands.LINKS], self.violations[0]])

    @ti.func
    def _fetch_ahead(self, first, end):
        """Have fetched what playing some islands begins with.

        Their spheres are far apart in memory, and where each is asked for when it is needed, each is waited for. Here one does
        not wait for another: first the spheres, then where their partners are written, then those.
        """
        begin = self.islands.begin[self.islands.pending[first]]
        last = self.islands.pending[end - 1]
        stop = self.islands.begin[last] + self.islands.size[last]
        for p in range(begin, stop):
            k = self.islands.members[p]
            prefetch(self.start_position, k)
            prefetch(self.local_position, k)
            prefetch(self.islands.best_time, k)
            prefetch(self.islands.first_time, k)
            prefetch(self.partners.begin, k)
            prefetch(self.near, k)
        for p in range(begin, stop):
            self.partners.fetch(self.islands.members[p])
        for p in range(begin, stop):
            k = self.islands.members[p]
            for r in range(self.partners.count_of(k)):
                other = self.partners.partner_of(k, r)
                prefetch(self.start_position, other)
                prefetch(self.islands.island, other)

    @ti.func
    def _see_other_island(self, k, other, h, _):
        """Join two islands where spheres may have met: neither left a ball around its start, and the balls meet."""
        is_in_another = self.islands.island[other] >= 0 and self.islands.island[other] != self.islands.island[k]
        if is_in_another and (self.near[k] == 1 or self.near[other] == 1):
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
                self._commit_chunk(q // grain, h)

    @ti.kernel
    def _commit_slots(self, h: float) -> ti.types.vector(10, ti.f64):
        """The same, and how the spheres move now, while they are at hand."""
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if q % grain == 0:
                way = self._commit_chunk(q // grain, h)
                self.flight.measure_chunk(q // grain, self.start_position, self.start_velocity, way)
        return self.flight.whole()

    @ti.func
    def _commit_chunk(self, chunk, h):
        """Returns the longest way that a sphere came."""
        square = 0.0
        for k in range(self.tally.begin_of(chunk), self.tally.begin_of(chunk + 1)):
            way = self.start_velocity[k] * h
            if self.islands.island[k] >= 0:
                way = self.local_position[k] - self.start_position[k]
                self._keep(chunk, k, h)
            else:
                self._fly_on(k, h)
            square = ti.max(square, way.norm_sqr())
        return ti.sqrt(square)

    @ti.func
    def _fly_on(self, k, h):
        i = self.index(k)
        x = self.start_position[k] + self.start_velocity[k] * h
        if ti.static(self.in_slots):
            self.start_position[k] = x
        else:
            self.state.position[i] = x
        if ti.static(self.keeps_last_contact):
            self.last_contact[i] = self.last_contact[i] - h
