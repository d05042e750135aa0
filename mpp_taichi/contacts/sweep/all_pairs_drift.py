"""The drift of few spheres: all of them are one island from the beginning, and one thread plays it."""

import taichi as ti

from mpp_taichi.contacts.sweep.first_contacts import FirstContacts
from mpp_taichi.contacts.sweep.island_player import IslandPlayer
from mpp_taichi.contacts.sweep.sweep_parts import SweepParts


@ti.data_oriented
class AllPairsDrift:
    """Tests all pairs, plays their island and moves the spheres, in one launch."""

    def __init__(self, parts: SweepParts, player: IslandPlayer) -> None:
        """Bind the parts."""
        self.player, self.islands, self.tally, self.watch = player, parts.islands, parts.tally, parts.watch
        self.first_contacts = FirstContacts(parts)
        self.particle_count = parts.slots.particle_count

    def destroy(self) -> None:
        """Own no memory."""

    def drift(self, time: float, h: float) -> None:
        """Move all spheres by h along their velocities, contacts resolved on the way."""
        self._drift(time, h)

    @ti.kernel
    def _drift(self, time: float, h: float):
        ti.loop_config(serialize=self.watch.on_cpu)
        for _ in range(1):
            self._play_all(time, h)
            if self.watch.was_stopped():
                self.tally.give_up(0, 1)

    @ti.func
    def _play_all(self, time, h):
        self.islands.everything()
        for i in range(self.particle_count):
            wall = self.first_contacts.first_wall(i, time, h)
            self.islands.first_time[i] = wall[0]
            self.islands.first_partner[i] = ti.cast(wall[1], ti.i32)
        for i in range(self.particle_count):
            for j in range(i + 1, self.particle_count):
                self._offer_first(i, j, h)
        self.player.play(0, time, h)
        for i in range(self.particle_count):
            self.player.keep(0, i, h)

    @ti.func
    def _offer_first(self, i, j, h):
        """Note the first contact of a pair, unless the player predicts everything anew for the nearest images."""
        separation = self.first_contacts.separation(i, j)
        self.first_contacts.see_overlap(i, j, separation)
        if ti.static(not self.player.looks_again):
            t = self.first_contacts.time_of_pair(i, j, separation, h)
            if t < self.islands.first_time[i]:
                self.islands.first_time[i] = t
                self.islands.first_partner[i] = j
            if t < self.islands.first_time[j]:
                self.islands.first_time[j] = t
                self.islands.first_partner[j] = i
