"""Islands on a device of many threads: joined by all threads together, without lists that threads append to."""

import taichi as ti

from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.sweep.islands import Islands
from mpp_taichi.neighbors.prefix_sum import PrefixSum

JOINS, JOINED, STOPPED = 0, 1, 2
HOOKS_AT_ONCE = 4  # launches before the host asks whether all islands are joined


@ti.data_oriented
class DeviceIslands:
    """Fills the tables of `Islands`: which spheres are in an island, and which islands are to be played.

    An island is known by its smallest index. In `wish` each sphere notes a sphere with which it is to be joined, of several
    spheres the one with the lowest number; the others are found in the next round. Labels sink along wishes, and to the labels
    of labels, until none changes. Each thread writes to the places of its own sphere or island, or all write the same number.

    wish      (n,) a sphere whose island is to be joined with the island of this sphere, or −1
    label     (n,) smallest index of the island that is known so far
    involved  (n,) 1: has a contact, or was joined to spheres that have one
    renewed   (n,) 1 at the label of an island that is to be played
    flag      JOINS: some sphere wishes to be joined; JOINED: all are; STOPPED: the device ended the loops of a thread
    """

    def __init__(self, islands: Islands) -> None:
        """Allocate for the spheres of `islands`."""
        n = self.particle_count = islands.particle_count
        self.islands = islands
        self.sums = PrefixSum(n)
        fields = [ti.field(ti.i32) for _ in range(8)]
        self.wishes, self.label, self.involved, self.renewed, self.arrival, self.arrived, self.first, self.is_played = fields
        self.flag = ti.field(ti.i32)
        self._trees = FieldTrees()
        for field in fields:
            self._trees.place(n + 1, integers=[field])
        self._trees.place(3, integers=[self.flag])
        self._trees.finish()

    def destroy(self) -> None:
        """Give the memory back."""
        self.sums.destroy()
        self._trees.destroy()

    @ti.func
    def begin(self, k):
        """Make sphere k an island of its own, to be played if its first contact is known to `islands`."""
        self.wishes[k] = ti.max(self.islands.first_partner[k], -1)
        self.label[k] = k
        self.renewed[k] = self.involved[k]

    @ti.func
    def wish(self, k, other):
        """Note that the islands of k and other are to be joined."""
        if self.wishes[k] < 0 or self.islands.number(other) < self.islands.number(self.wishes[k]):
            self.wishes[k] = other
        self.flag[JOINS] = 1

    def count_involved(self) -> int:
        """Number of spheres that have a contact."""
        self.sums.run(self.involved, self.first, self.particle_count)
        return self._last_sum()

    @ti.kernel
    def _last_sum(self) -> ti.i32:
        return self.first[self.particle_count]

    def form(self) -> None:
        """Join the islands that wishes connect, and list the members of all islands that changed."""
        while True:
            for _ in range(HOOKS_AT_ONCE):
                self._hook()
            if self._are_joined() == 1:
                break
        self._count_members()
        self.sums.run(self.islands.size, self.islands.begin, self.particle_count - 1)
        self._enter_members()
        self.sums.run(self.is_played, self.first, self.particle_count)
        self._list_pending()

    @ti.kernel
    def _hook(self):
        for k in range(self.particle_count):
            if self.wishes[k] >= 0:
                one, other = self.label[k], self.label[self.wishes[k]]
                if one != other:
                    ti.atomic_min(self.label[ti.max(one, other)], ti.min(one, other))
        for k in range(self.particle_count):
            self.label[k] = self.label[self.label[k]]

    @ti.kernel
    def _are_joined(self) -> ti.i32:
        for _ in range(1):
            self.flag[JOINED] = 1
        for k in range(self.particle_count):
            label = self.label[k]
            if self.label[label] != label:
                self.flag[JOINED] = 0
            if self.wishes[k] >= 0:
                if self.label[self.wishes[k]] != label:
                    self.flag[JOINED] = 0
        return self.flag[JOINED]

    @ti.kernel
    def _count_members(self):
        for k in range(self.particle_count):
            self.islands.size[k] = 0
            if self.wishes[k] >= 0:
                self.involved[self.wishes[k]] = 1
                self.renewed[self.label[k]] = 1
        for k in range(self.particle_count):
            root = self.label[k]
            self.wishes[k] = -1
            self.islands.island[k] = -1
            if self.involved[k] == 1:
                self.islands.island[k] = root
                if self.renewed[root] == 1:
                    self.arrival[k] = ti.atomic_add(self.islands.size[root], 1)

    @ti.kernel
    def _enter_members(self):
        for k in range(self.particle_count):
            root = self.label[k]
            if self.involved[k] == 1 and self.renewed[root] == 1:
                self.arrived[self.islands.begin[root] + self.arrival[k]] = k
        for k in range(self.particle_count):
            root = self.label[k]
            self.is_played[k] = ti.cast(self.islands.size[k] > 0, ti.i32)
            if self.involved[k] == 1 and self.renewed[root] == 1:
                begin = self.islands.begin[root]
                place = 0
                for other in range(begin, begin + self.islands.size[root]):
                    if self.arrived[other] < k:
                        place += 1
                self.islands.members[begin + place] = k
                self.islands.place[k] = place

    @ti.kernel
    def _list_pending(self):
        for k in range(self.particle_count):
            self.renewed[k] = 0
            if self.is_played[k] == 1:
                self.islands.pending[self.first[k]] = k

    @ti.func
    def pending_count(self):
        """Number of islands that are to be played."""
        return self.first[self.particle_count]
