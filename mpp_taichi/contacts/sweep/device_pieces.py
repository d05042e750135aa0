"""The steps of a piece on a device of many threads: all threads find the islands together, then each thread plays one."""

import taichi as ti

from mpp_taichi.contacts.sweep.device_islands import JOINS, STOPPED, DeviceIslands
from mpp_taichi.contacts.sweep.drift_planning import Piece
from mpp_taichi.contacts.sweep.first_contacts import FirstContacts
from mpp_taichi.contacts.sweep.island_player import IslandPlayer
from mpp_taichi.contacts.sweep.piece_drift import PieceSteps
from mpp_taichi.contacts.sweep.sweep_parts import SweepParts


@ti.data_oriented
class DevicePieces(PieceSteps):
    """The island of a sphere begins as the two spheres of its first contact; its other members are found while it is played."""

    def __init__(self, parts: SweepParts, player: IslandPlayer, device_islands: DeviceIslands) -> None:
        """Bind the parts."""
        self.player, self.device_islands, self.first_contacts = player, device_islands, FirstContacts(parts)
        self.slots, self.played, self.islands, self.tally = parts.slots, parts.played, parts.islands, parts.tally
        self.planner, self.grid, self.watch = parts.planner, parts.grid, parts.watch
        self.particle_count = parts.slots.particle_count
        self._was_stopped = False

    def destroy(self) -> None:
        """Give the memory back."""
        self.device_islands.destroy()

    # Search for first contacts

    def search(self, time: float, h: float) -> int:
        """Find the first contact of each sphere; returns about how many contacts there are."""
        self._find_first(time, h)
        return self.device_islands.count_involved() // 2

    @ti.kernel
    def _find_first(self, time: float, h: float):
        for _ in range(1):
            self.planner.violations[0] = 0
        for k in range(self.particle_count):
            wall = self.first_contacts.first_wall(k, time, h)
            self.islands.first_time[k] = ti.math.inf
            self.islands.first_partner[k] = -1
            if wall[0] <= h:
                self.islands.first_time[k] = wall[0]
                self.islands.first_partner[k] = ti.cast(wall[1], ti.i32)
            self.grid.visit(k, self._see_first, h, h)
            self.device_islands.involved[k] = ti.cast(self.islands.first_time[k] <= h, ti.i32)
            self.device_islands.begin(k)
            if self.watch.was_stopped():
                self.tally.give_up(k, 1)

    @ti.func
    def _see_first(self, k, other, h, _):
        if other != k:
            separation = self.first_contacts.separation(k, other)
            self.first_contacts.see_overlap(k, other, separation)
            t = self.first_contacts.time_of_pair(k, other, separation, h)
            if t <= h:
                self.islands.offer(k, other, t)

    # Islands of a piece

    def play(self, time: float, h: float, *, is_first: bool) -> tuple[int, int]:
        """Form the islands that changed and play them; returns whether islands must be joined, and whether a margin failed."""
        self.device_islands.form()
        self._play_pending(time, h)
        self._look_for_joins(h)
        joins, violations, stopped = self._outcome()
        self._was_stopped = stopped == 1
        if violations == 1:
            self.planner.find_farthest()
        return joins, violations + stopped

    @ti.kernel
    def _play_pending(self, time: float, h: float):
        for _ in range(1):
            self.device_islands.flag[JOINS] = 0
            self.device_islands.flag[STOPPED] = 0
        for q in range(self.device_islands.pending_count()):
            self.player.play(self.islands.pending[q], time, h)
            if self.watch.was_stopped():
                self.device_islands.flag[STOPPED] = 1

    @ti.kernel
    def _look_for_joins(self, h: float):
        for k in range(self.particle_count):
            if self.device_islands.involved[k] == 1:
                if self.played.near[k] == 1:
                    self.grid.visit(k, self.player.see_other_island, h, h)

    @ti.kernel
    def _outcome(self) -> ti.types.vector(3, ti.i32):
        joins, stopped = self.device_islands.flag[JOINS], self.device_islands.flag[STOPPED]
        return ti.Vector([joins, self.planner.violations[0], stopped])

    def retry(self, piece: Piece) -> Piece:
        """A shorter piece where a thread had so many contacts that the device ended its loops; else wider margins."""
        return self.planner.shorten(piece) if self._was_stopped else self.planner.widen(piece)

    # The end of a piece

    def commit(self, h: float) -> None:
        """Put all spheres of the state where they are at the end of the piece."""
        self._commit(h)

    @ti.kernel
    def _commit(self, h: float):
        for k in range(self.particle_count):
            if self.islands.island[k] >= 0:
                self.player.keep(k, k, h)
            else:
                self.player.fly_on(k, h)
