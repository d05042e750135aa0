"""Islands: spheres whose contacts within a drift may depend on each other, and the order of events in an island."""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.device.fast_taichi.prefetch import prefetch

LINKS_AHEAD = 16  # links whose spheres are fetched before they are joined
LINKS_PER_SPHERE = 8  # a contact graph of spheres has fewer than 7.5 edges for each: half the mean kissing number, below 14.96


@ti.data_oriented
class Islands:
    """Sets of linked spheres, each known by its smallest index, so that the order of the links does not matter.

    island          (n,) its root, or -1: the sphere flies freely
    first_time      (n,) its first contact if nothing else happens [time], with first_partner
    following       (n,) another sphere of the same island: one after the other, they form a ring
    pending         roots of the islands that are to be played, `count[PENDING]` of them
    members         the spheres of pending islands, `count[MEMBERS]` in all: the spheres of an island from `begin[root]` on,
                    `size[root]` of them, in an order on which no result may depend
    involved        the spheres of all islands, `count[INVOLVED]` of them
    links           pairs that were linked since the islands were last formed, `count[LINKS]` of them
    """

    LINKS, INVOLVED, PENDING, MEMBERS = 0, 1, 2, 3

    def __init__(self, particle_count: int, beside: Sequence[Any], indices: Sequence[Any], order: Any = None) -> None:
        """Allocate; needs a started Taichi.

        beside    fields of floats that an event touches, to be placed beside the fields that are made here
        indices   the same, of integers
        order     numbers of the spheres, by which events at one time are ordered; None: their indices here

        Spheres of an island are far apart in memory, and to fetch a line of memory costs more than to evaluate the formulas.
        """
        self.particle_count = particle_count
        self.has_order, self.order = order is not None, order
        self.capacity = LINKS_PER_SPHERE * particle_count + 64
        self.parent, self.island, self.members, self.begin, self.size = (ti.field(ti.i32) for _ in range(5))
        self.following, self.changed, self.pending, self.involved, self.tree = (ti.field(ti.i32) for _ in range(5))
        self.place, self.first_partner = ti.field(ti.i32), ti.field(ti.i32)
        self.filler = ti.field(ti.i32)  # pads the entry of a sphere to two lines of memory, in f64 and three dimensions
        self.first_time, self.best_time, self.link_time = (ti.field(float) for _ in range(3))
        self.links = ti.Vector.field(2, ti.i32)
        self.count = ti.field(ti.i32)
        self._trees = FieldTrees()
        self._trees.place(particle_count, *beside, self.best_time, integers=(*indices, self.place, self.filler))
        of_roots = (self.begin, self.size, self.following, self.changed)
        self._trees.place(particle_count, self.first_time, integers=(*of_roots, self.first_partner))
        for field in (self.parent, self.island, self.members, self.pending, self.involved, self.tree):
            self._trees.place(particle_count, integers=[field])
        self._trees.place(self.capacity, self.link_time)
        self._trees.place(self.capacity, integers=[self.links])
        self._trees.place(4, integers=[self.count])
        self._trees.finish()
        self.parent.fill(-1)
        self.island.fill(-1)

    def destroy(self) -> None:
        """Give the memory back."""
        self._trees.destroy()

    # Search for the spheres of an island

    @ti.func
    def link(self, i, j, time):
        """Note that i and j belong together, or that i meets a surface, j < 0, at `time`; infinity if it is not known."""
        k = ti.atomic_add(self.count[self.LINKS], 1)
        if k < self.capacity:
            self.links[k] = ti.Vector([i, j])
            self.link_time[k] = time

    @ti.func
    def wish(self, i, j):
        """Note that i and j, which are played already, shall be in one island when it is played again."""
        self.link(i, j, ti.math.inf)

    @ti.func
    def form(self):
        """Join the spheres that are linked, and list all islands that changed as pending; inside a serialized loop."""
        for k in range(self.count[self.PENDING]):
            self.changed[self.pending[k]] = 0
        link_count = ti.min(self.count[self.LINKS], self.capacity)
        for k in range(link_count):
            self._fetch_ahead(ti.min(k + LINKS_AHEAD, link_count - 1))
            i, j = self.links[k][0], self.links[k][1]
            self._enter(i)
            self.offer(i, j, self.link_time[k])
            if j >= 0:
                self._enter(j)
                self.offer(j, i, self.link_time[k])
                self._join(self._root(i), self._root(j))
        pending, members = 0, 0
        for k in range(link_count):
            root = self._root(self.links[k][0])
            if self.changed[root] == 0:
                self.changed[root] = 1
                self.pending[pending] = root
                pending += 1
                members = self._list_members(root, members)
        self.count[self.LINKS] = 0
        self.count[self.PENDING] = pending
        self.count[self.MEMBERS] = members

    @ti.func
    def _fetch_ahead(self, k):
        """Fetch the entries of linked spheres before they are needed, as memory is slow to answer."""
        i, j = self.links[k][0], ti.max(self.links[k][1], 0)
        prefetch(self.first_time, i)
        prefetch(self.first_time, j)
        prefetch(self.parent, i)
        prefetch(self.parent, j)

    @ti.func
    def _enter(self, i):
        if self.parent[i] < 0:
            self.parent[i] = i
            self.following[i] = i
            self.first_time[i] = ti.math.inf
            self.first_partner[i] = -1
            self.changed[i] = 0
            self.involved[self.count[self.INVOLVED]] = i
            self.count[self.INVOLVED] += 1

    @ti.func
    def _join(self, one, other):
        """Make two islands one, by their roots, unless they are one already.

        Two rings become one ring when the spheres that follow their roots are exchanged.
        """
        if one != other:
            self.parent[ti.max(one, other)] = ti.min(one, other)
            after = self.following[one]
            self.following[one] = self.following[other]
            self.following[other] = after

    @ti.func
    def _list_members(self, root, begin):
        """List the members of an island from the place `begin` on; returns the place after the last."""
        self.begin[root] = begin
        place, i = begin, root
        listing = True
        while listing:
            self.members[place] = i
            self.place[i] = place - begin
            self.island[i] = root
            place += 1
            i = self.following[i]
            listing = i != root
        self.size[root] = place - begin
        return place

    @ti.func
    def leave(self, i):
        """Take sphere i out of its island; to be called for all of its members."""
        self.parent[i] = -1
        self.island[i] = -1

    @ti.func
    def offer(self, i, j, time):
        """Note a contact of i if it is the first that was offered; of contacts at one time, the lowest partner comes first."""
        if time < self.first_time[i] or (time == self.first_time[i] and self.number(j) < self.number(self.first_partner[i])):
            self.first_time[i] = time
            self.first_partner[i] = j

    @ti.func
    def number(self, i):
        """Number of sphere i, by which events at one time are ordered; numbers of surfaces, i < 0, stay as they are."""
        result = i
        if ti.static(self.has_order):
            if i >= 0:
                result = self.order[i]
        return result

    @ti.func
    def _root(self, i):
        node = i
        while self.parent[node] != node:
            self.parent[node] = self.parent[self.parent[node]]
            node = self.parent[node]
        return node

    @ti.func
    def everything(self):
        """Form one island of all spheres, with root 0; inside a serialized loop."""
        for i in range(self.particle_count):
            self.island[i] = 0
            self.members[i] = i
            self.place[i] = i
        self.begin[0] = 0
        self.size[0] = self.particle_count

    # The earliest event: a tournament over the members, whose inner nodes 1 … size − 1 keep the places of the winners

    @ti.func
    def start_tournament(self, root):
        """Play all matches, after `best_time` of all members was set."""
        size = self.size[root]
        for back in range(1, size):
            self._play(self.begin[root], size, size - back)

    @ti.func
    def replay(self, root, i):
        """Play the matches of member i again, after `best_time[i]` was changed."""
        size = self.size[root]
        node = (self.place[i] + size) // 2
        while node >= 1:
            self._play(self.begin[root], size, node)
            node //= 2

    @ti.func
    def next(self, root):
        """The member with the earliest event; of members with events at one time, the one with the smallest number."""
        p = 0
        if self.size[root] > 1:
            p = self.tree[self.begin[root] + 1]
        return self.members[self.begin[root] + p]

    @ti.func
    def _play(self, begin, size, node):
        left = self._winner(begin, size, 2 * node)
        right = self._winner(begin, size, 2 * node + 1)
        one, other = self.members[begin + left], self.members[begin + right]
        is_first = self.best_time[one] < self.best_time[other]
        if self.best_time[one] == self.best_time[other]:
            is_first = self.number(one) < self.number(other)
        self.tree[begin + node] = left if is_first else right

    @ti.func
    def _winner(self, begin, size, node):
        result = node - size
        if node < size:
            result = self.tree[begin + node]
        return result
