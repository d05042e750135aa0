"""The queue of an event-driven run: one event per sphere, the earliest first, O(1) per event."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts.events.lines import Lines
from mpp_taichi.contacts.events.spheres import FlyingSpheres

# Events that a bucket is made to hold: with few, lists are short; with many, the heads of all lists stay in the cache.
PER_BUCKET = 4
# Events of a window that are dealt with before the width of its buckets is chosen again, in spheres.
MOST_EVENTS = 8
# Factor by which a window at most becomes longer or shorter than the one before.
LARGEST_CHANGE = 16.0


@ti.data_oriented
class EventQueue:
    """A bounded increasing queue: a window of time is cut into one bucket for PER_BUCKET spheres.

    A bucket is a linked list of notes, of spheres whose events were to fall into it; only that of the present is a heap, of a
    few events. What lies behind the window waits until the window moves on, and is then sorted in; the width of a bucket
    follows the rate of events. An event is named by its sphere, so a new one replaces the old in O(1): the old note stays
    where it is, for to take it away one would touch its neighbours in the list, which lie anywhere in memory; it is dropped
    when its bucket comes. Equal times come in the order of the scene's spheres, wherever these are: both spheres of a
    contact have it as an event.

    time      of the next event of each sphere; infinity: none
    partner   with whom: see `event_driven`
    stamp     how many contacts the partner had had when this was predicted; if more by now, it no longer holds
    place     where that event is: in the heap, in a bucket, or nowhere

    Source: Paul, J. Comput. Phys. 221 (2007) 615 (physics/0606226).
    """

    def __init__(self, spheres: FlyingSpheres, lines: Lines, builder: Any) -> None:
        """Place the fields, one event for each of these spheres."""
        self.spheres, self.count, self.bucket_count = spheres, spheres.count, max(spheres.count // PER_BUCKET, 8)
        self.wide = wide = spheres.wide
        self.time, self.partner, self.stamp = lines.field(wide), lines.field(ti.i32), lines.field(ti.i32)
        self.place = lines.field(ti.i32)
        self.first = ti.field(ti.i32)
        builder.dense(ti.i, self.bucket_count).place(self.first)
        self.heap = ti.field(ti.i32)
        builder.dense(ti.i, self.count).place(self.heap)
        # Notes: of whom, and the next one in the bucket. `unused` are in a list too, from `fresh` on they are in none.
        # A window begins with one for each sphere, and each change makes one; `earliest` counts them once for two.
        self.sphere, self.next = ti.field(ti.i32), ti.field(ti.i32)
        self.most = MOST_EVENTS * max(self.count, 8)
        builder.dense(ti.i, self.count + self.most + 4).place(self.sphere, self.next)
        self.unused, self.fresh = ti.field(ti.i32), ti.field(ti.i32)
        builder.place(self.unused, self.fresh)
        self.heap_size, self.bucket, self.taken = ti.field(ti.i32), ti.field(ti.i32), ti.field(ti.i32)
        self.start, self.width = ti.field(wide), ti.field(wide)
        builder.place(self.heap_size, self.bucket, self.taken)
        builder.place(self.start, self.width)

    def clear(self, time: float, partner: int) -> None:
        """The same event for every sphere, now."""
        self.time.fill(time)
        self.partner.fill(partner)
        self.place.fill(ABSENT)
        self.width[None] = 0.0
        self.heap_size[None] = 0
        self.bucket[None] = self.bucket_count

    @ti.func
    def earliest(self):
        """The sphere whose event is next, or −1 if there is none; it stays in the queue."""
        attempts = 2
        if self.taken[None] > self.most:
            self.bucket[None] = self.bucket_count
            self.heap_size[None] = 0
        while attempts > 0:
            attempts -= 1
            self._fill_heap()
            if self.heap_size[None] > 0:
                attempts = 0
            elif attempts > 0:
                self._sort_anew()
        return self.heap[0] if self.heap_size[None] > 0 else -1

    @ti.func
    def change(self, i, time, partner, stamp):
        """Give sphere i another event."""
        self.taken[None] += 1
        place = self.place[i]
        self.time[i], self.partner[i], self.stamp[i] = time, partner, stamp
        # In the heap one sphere is to be settled at most: i itself, or the last one where i was.
        b = self._bucket_of(time)
        mover, hole = i, place
        if b <= self.bucket[None]:
            if place < 0:
                hole = self.heap_size[None]
                self.heap_size[None] += 1
        else:
            if place >= 0:
                self.heap_size[None] -= 1
                mover = self.heap[self.heap_size[None]]
                if mover == i:
                    hole = -1
            self._note(i, b)
        if hole >= 0:
            self._settle(mover, hole)

    @ti.func
    def _sort_anew(self):
        """Begin a window at the earliest event, with PER_BUCKET events to a bucket if the rate stays as it was."""
        begin = ti.cast(ti.math.inf, self.wide)
        last = ti.cast(-ti.math.inf, self.wide)
        total = 0
        for i in range(self.count):
            self.place[i] = ABSENT
            if self.time[i] < ti.math.inf:
                begin = ti.min(begin, self.time[i])
                last = ti.max(last, self.time[i])
                total += 1
        for b in range(self.bucket_count):
            self.first[b] = -1
        if total > 0:
            width = ti.cast(0, self.wide)
            if self.width[None] == 0:
                width = self._typical_wait(begin) * PER_BUCKET / total
            else:
                width = (begin - self.start[None]) * PER_BUCKET / ti.max(self.taken[None], 1)
                width = ti.math.clamp(width, self.width[None] / LARGEST_CHANGE, self.width[None] * LARGEST_CHANGE)
            # A bucket shorter than the time's own spacing would tell nothing apart.
            self.width[None] = ti.max(width, self._smallest_width(begin)) if last > begin else ti.cast(0, self.wide)
            self.start[None] = begin
        self.bucket[None] = -1
        self.heap_size[None] = 0
        self.taken[None] = 0
        self.unused[None], self.fresh[None] = -1, 0
        for i in range(self.count):
            self._note(i, self._bucket_of(self.time[i]))

    @ti.func
    def _typical_wait(self, begin):
        """Mean of the waits no longer than the mean, and so on while a few spheres with very long ones made up most of it."""
        longest, mean = ti.cast(ti.math.inf, self.wide), ti.cast(0, self.wide)
        looking = True
        while looking:
            waits, count = ti.cast(0, self.wide), 0
            for i in range(self.count):
                wait = self.time[i] - begin
                if wait < ti.math.inf and wait <= longest:
                    waits += wait
                    count += 1
            mean = waits / count
            looking = mean > 0 and mean < longest / 4
            longest = mean
        return mean

    @ti.func
    def _smallest_width(self, time):
        """A few steps of the float that a time is."""
        return ti.max(ti.abs(time) * ti.static(4e-7 if self.wide == ti.f32 else 1e-15), 1e-30)

    @ti.func
    def _fill_heap(self):
        """Go on to the next bucket that holds an event."""
        while self.heap_size[None] == 0 and self.bucket[None] < self.bucket_count - 1:
            self.bucket[None] += 1
            bucket = self.bucket[None]
            note = self.first[bucket]
            self.first[bucket] = -1
            while note >= 0:
                i, after = self.sphere[note], self.next[note]
                self.next[note] = self.unused[None]
                self.unused[None] = note
                if self.is_in(i, bucket):
                    self.heap_size[None] += 1
                    self._settle(i, self.heap_size[None] - 1)
                note = after

    @ti.func
    def _bucket_of(self, time):
        """The bucket of a time, or their number if it is behind the window."""
        result = self.bucket_count
        if time <= self.start[None]:
            result = 0
        elif self.width[None] > 0:
            b = (time - self.start[None]) / self.width[None]
            if b < self.bucket_count:
                result = ti.cast(b, ti.i32)
        return result

    @ti.func
    def is_in(self, i, bucket):
        """Whether the event of sphere i is in this bucket: a note of it there may be out of date."""
        return self.place[i] == FIRST_BUCKET - bucket

    @ti.func
    def _note(self, i, bucket):
        """Note sphere i in a bucket, if that is not behind the window and has no note of it."""
        if bucket >= self.bucket_count:
            self.place[i] = ABSENT
        elif not self.is_in(i, bucket):
            note = self.unused[None]
            if note >= 0:
                self.unused[None] = self.next[note]
            else:
                note = self.fresh[None]
                self.fresh[None] += 1
            self.sphere[note], self.next[note] = i, self.first[bucket]
            self.first[bucket] = note
            self.place[i] = FIRST_BUCKET - bucket

    @ti.func
    def _settle(self, i, place):
        """Put i where the heap has a hole, up or down from there."""
        hole, rises = place, True
        # `and` would look at both of its sides, also where the heap has no such place.
        while hole > 0 and rises:
            parent = (hole - 1) // 2
            rises = self._before(i, self.heap[parent])
            if rises:
                self._set(hole, self.heap[parent])
                hole = parent
        child = 2 * hole + 1
        while child < self.heap_size[None]:
            if child + 1 < self.heap_size[None]:
                if self._before(self.heap[child + 1], self.heap[child]):
                    child += 1
            if self._before(self.heap[child], i):
                self._set(hole, self.heap[child])
                hole = child
                child = 2 * hole + 1
            else:
                child = self.heap_size[None]
        self._set(hole, i)

    @ti.func
    def _set(self, hole, i):
        self.heap[hole] = i
        self.place[i] = hole

    @ti.func
    def _before(self, i, j):
        result = self.time[i] < self.time[j]
        if self.time[i] == self.time[j]:
            a, b = self._names(i), self._names(j)
            result = a[0] < b[0] or (a[0] == b[0] and (a[1] < b[1] or (a[1] == b[1] and i < j)))
        return result

    @ti.func
    def _names(self, i):
        """The scene's numbers of those whom the event of sphere i is about, the lower one first."""
        j = self.partner[i]
        own = self.spheres.order[i]
        other = own
        if j >= 0 and j < self.count:
            other = self.spheres.order[j]
        return ti.Vector([ti.min(own, other), ti.max(own, other)])


# Where a sphere's event is, if it is not at a place in the heap: nowhere, or in bucket FIRST_BUCKET − b.
ABSENT = -1
FIRST_BUCKET = -2
