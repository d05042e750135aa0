"""The steps of a piece on the CPU: a search by chunks of slots, and islands that are played in parallel."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts.shared.contact_counts import CHUNKS
from mpp_taichi.contacts.sweep.drift_planning import Piece
from mpp_taichi.contacts.sweep.first_contacts import FirstContacts
from mpp_taichi.contacts.sweep.island_player import IslandPlayer
from mpp_taichi.contacts.sweep.piece_drift import PieceSteps
from mpp_taichi.contacts.sweep.sweep_parts import SweepParts
from mpp_taichi.device.fast_taichi.prefetch import prefetch
from mpp_taichi.device.heavy_loops import is_heavy, loop_grain
from mpp_taichi.types import Template

TOGETHER = 8  # islands whose memory is fetched at once
BLOCK = 16  # slots whose partners are fetched at once


@ti.data_oriented
class IslandPieces(PieceSteps):
    """First contacts become links of islands; a thread plays TOGETHER islands, or one thread all of them in turn.

    The processor is told in advance which memory will be read. The spheres of islands are far apart in memory, and a thread
    that fetches each of them only when it is needed waits for each.
    """

    def __init__(self, parts: SweepParts, player: IslandPlayer, *, in_turn: bool) -> None:
        """Bind the parts; `in_turn` plays the islands one after the other."""
        self.player, self.in_turn = player, in_turn
        self.slots, self.played, self.islands, self.tally = parts.slots, parts.played, parts.islands, parts.tally
        self.planner, self.candidates, self.grid = parts.planner, parts.candidates, parts.grid
        self.partners: Any = parts.candidates.partners
        self.first_contacts = FirstContacts(parts)
        self.particle_count = parts.slots.particle_count

    def destroy(self) -> None:
        """Own no memory."""

    def search(self, time: float, h: float) -> int:
        """Link all pairs that meet, and note all contacts with surfaces; returns how many."""
        return self._search(time, h, self.candidates.is_listed)

    def play(self, time: float, h: float, *, is_first: bool) -> tuple[int, int]:
        """Form the islands that changed and play them; returns how many links there are, and whether a margin failed."""
        links, violations = self._play_islands(time, h, self.candidates.is_listed, int(is_first))
        return links, violations

    def retry(self, piece: Piece) -> Piece:
        """The piece again with wider margins."""
        return self.planner.widen(piece)

    def commit(self, h: float) -> None:
        """Put all spheres where they are at the end of the piece, in the state or in their slots."""
        if self.slots.stay:
            motion = self.planner.motion(self._commit_slots(h))
            self.slots.keep(motion)
            self.candidates.add_way(motion.way)
        else:
            self._commit(h)

    # Search for first contacts

    @ti.kernel
    def _search(self, time: float, h: float, listed: Template) -> ti.i32:
        for k in range(self.islands.count[self.islands.INVOLVED]):
            self.islands.leave(self.islands.involved[k])
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.islands.count[self.islands.LINKS] = 0
            self.islands.count[self.islands.INVOLVED] = 0
            self.islands.count[self.islands.PENDING] = 0
            self.planner.violations[0] = 0
        if ti.static(listed):
            grain = ti.static(loop_grain())
            for q in range(CHUNKS * grain):
                if is_heavy(q, grain):
                    chunk = q // grain
                    begin, end = self.tally.begin_of(chunk), self.tally.begin_of(chunk + 1)
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
        wall = self.first_contacts.first_wall(k, time, h)
        if wall[0] <= h:
            self.islands.link(k, ti.cast(wall[1], ti.i32), wall[0])

    @ti.func
    def _fetch_partners(self, first, end):
        """Fetch the later partners of some slots, before they are read one by one."""
        if first < end:
            for p in range(self.partners.begin[first], self.partners.middle[end - 1]):
                prefetch(self.slots.position, self.partners.partner[p])

    @ti.func
    def _see_pair(self, k, other, time, h):
        separation = self.first_contacts.separation(k, other)
        self.first_contacts.see_overlap(k, other, separation)
        t = self.first_contacts.time_of_pair(k, other, separation, h)
        if t <= h:
            self.islands.link(k, other, t)

    # Islands of a piece

    @ti.kernel
    def _play_islands(self, time: float, h: float, listed: Template, is_first: ti.i32) -> ti.types.vector(2, ti.i32):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.islands.form()
        if ti.static(self.in_turn or not listed):
            ti.loop_config(serialize=self.in_turn)
            for k in range(self.islands.count[self.islands.PENDING]):
                self.player.play(self.islands.pending[k], time, h)
        else:
            grain = ti.static(loop_grain())
            for q in range((self.islands.count[self.islands.PENDING] + TOGETHER - 1) // TOGETHER * grain):
                if is_heavy(q, grain):
                    part = q // grain
                    first = part * TOGETHER
                    end = ti.min(first + TOGETHER, self.islands.count[self.islands.PENDING])
                    self._fetch_ahead(first, end)
                    for k in range(first, end):
                        self.player.play(self.islands.pending[k], time, h)
        for p in range(self.islands.count[self.islands.MEMBERS]):
            i = self.islands.members[p]
            if is_first == 0 or self.played.near[i] == 1:  # between islands that were not played again nothing has changed
                self.candidates.visit(i, self.player.see_other_island, h, h)
        return ti.Vector([self.islands.count[self.islands.LINKS], self.planner.violations[0]])

    @ti.func
    def _fetch_ahead(self, first, end):
        """Fetch the memory that the playing of some islands begins with.

        First the spheres are fetched, then the lists of their partners, then the partners: within each of these three loops
        no fetch waits for another.
        """
        begin = self.islands.begin[self.islands.pending[first]]
        last = self.islands.pending[end - 1]
        stop = self.islands.begin[last] + self.islands.size[last]
        for p in range(begin, stop):
            k = self.islands.members[p]
            prefetch(self.slots.position, k)
            prefetch(self.played.position, k)
            prefetch(self.islands.best_time, k)
            prefetch(self.islands.first_time, k)
            prefetch(self.partners.begin, k)
            prefetch(self.played.near, k)
        for p in range(begin, stop):
            self.partners.fetch(self.islands.members[p])
        for p in range(begin, stop):
            k = self.islands.members[p]
            for r in range(self.partners.count_of(k)):
                other = self.partners.partner_of(k, r)
                prefetch(self.slots.position, other)
                prefetch(self.islands.island, other)

    # The end of a piece

    @ti.kernel
    def _commit(self, h: float):
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if is_heavy(q, grain):
                chunk = q // grain
                self._commit_chunk(chunk, h)

    @ti.kernel
    def _commit_slots(self, h: float) -> ti.types.vector(10, ti.f64):
        """Commit to the slots, and summarize the motion while the spheres are in the cache."""
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if is_heavy(q, grain):
                chunk = q // grain
                way = self._commit_chunk(chunk, h)
                self.planner.measure_chunk(chunk, self.slots.position, self.slots.velocity, way)
        return self.planner.whole()

    @ti.func
    def _commit_chunk(self, chunk, h):
        """Commit the spheres of a chunk; returns the longest way of a sphere in this piece."""
        square = 0.0
        for k in range(self.tally.begin_of(chunk), self.tally.begin_of(chunk + 1)):
            way = self.slots.velocity[k] * h
            if self.islands.island[k] >= 0:
                way = self.played.position[k] - self.slots.position[k]
                self.player.keep(chunk, k, h)
            else:
                self.player.fly_on(k, h)
            square = ti.max(square, way.norm_sqr())
        return ti.sqrt(square)
