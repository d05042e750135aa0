"""The queue of an event-driven run: one event for each sphere, the earliest first, in O(1) for each event."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts.events.lines import Lines
from mpp_taichi.contacts.events.spheres import FlyingSpheres

# Mean number of events in a bucket: with few, lists are short; with many, the heads of all lists stay in the cache.
PER_BUCKET = 4
# Events for each sphere that a window may have before the width of its buckets is chosen again.
MOST_EVENTS = 8
# Largest factor by which a window becomes longer or shorter than the window before.
LARGEST_CHANGE = 16.0


@ti.data_oriented
class EventQueue:
    """A bounded increasing queue: a window of time is cut into one bucket for PER_BUCKET spheres.

    A bucket is a linked list of notes of the spheres whose events fall into it; only the present bucket is a heap, of a few
    events. Events behind the window wait until the window moves on, and are then sorted in; the width of a bucket follows the
    rate of events. An event is named by its sphere, so that a new event replaces the old one in O(1): the old note stays where
    it is and is dropped when its bucket comes, since its removal would touch its neighbours in the list, which may be anywhere
    in memory. Events at one time come in the order of the spheres in the scene, whatever their order in memory: both spheres
    of a contact have it as their event.

    time      (n,) time of the next event of a sphere; infinity: none
    partner   (n,) its partner, numbered as in `Prediction`
    stamp     (n,) number of contacts that the partner had had when the event was predicted; with more by now it is stale
    place     (n,) place of the event: in the heap, in a bucket, or nowhere

    Source: Paul, J. Comput. Phys. 221 (2007) 615 (physics/0606226).
    """

    def __init__(self, spheres: FlyingSpheres, lines: Lines, builder: Any) -> None:
        """Place the fields, one event for each of these spheres."""
        self.spheres, self.count, self.bucket_count = spheres, spheres.count, max(spheres.count // PER_BUCKET, 8)
        self.wide = wide = spheres.wide
        self.time, self.partner, self.stamp = lines.field(wide), lines.field(ti.i32), lines.field(ti.i32)
        self.place = lines.field(ti.i32)
        self.lasting = (self.time, self.partner, self.stamp)
        self.first = ti.field(ti.i32)
        builder.dense(ti.i, self.bucket_count).place(self.first)
        self.heap = ti.field(ti.i32)
        builder.dense(ti.i, self.count).place(self.heap)
        # Notes: their sphere, and the next note of the bucket. Notes from `unused` on are a list of free notes; notes
        # from `fresh` on are in no list yet. A window begins with a note for each sphere, and a change makes one at most.
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
        """Give every sphere the same event, at `time`."""
        self.time.fill(time)
        self.partner.fill(partner)
        self.place.fill(ABSENT)
        self.width[None] = 0.0
        self.heap_size[None] = 0
        self.bucket[None] = self.bucket_count

    @ti.func
    def earliest(self):
        """The sphere with the next event, or −1 if there is none; the event stays in the queue."""
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
        # At most one sphere has to find its place in the heap: i itself, or the last sphere of the heap where i was.
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
        """Begin a window at the earliest event, with PER_BUCKET events in a bucket if the rate of events stays the same."""
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
            # A bucket must not be shorter than the spacing of floating-point times.
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
        """Mean of the waits; while a few very long waits make up most of it, the mean of the waits no longer than it."""
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
        """A few spacings of floating-point times around `time`."""
        return ti.max(ti.abs(time) * ti.static(4e-7 if self.wide == ti.f32 else 1e-15), 1e-30)

    @ti.func
    def _fill_heap(self):
        """Go on to the next bucket that holds an event, and make it the heap."""
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
        """The bucket of a time, or the number of buckets if the time is behind the window."""
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
        """Whether the event of sphere i is in this bucket, where a note of the sphere may be stale."""
        return self.place[i] == FIRST_BUCKET - bucket

    @ti.func
    def _note(self, i, bucket):
        """Note sphere i in a bucket, unless the bucket is behind the window or has a valid note of the sphere."""
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
        """Put sphere i into a hole of the heap, or up or down from there."""
        hole, rises = place, True
        # Two conditions, as `and` would evaluate both sides, also where the heap has no such place.
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
        """Numbers in the scene of the two spheres of the event of sphere i, the lower number first."""
        j = self.partner[i]
        own = self.spheres.order[i]
        other = own
        if j >= 0 and j < self.count:
            other = self.spheres.order[j]
        return ti.Vector([ti.min(own, other), ti.max(own, other)])


# Place of an event that is not in the heap: nowhere, or FIRST_BUCKET − b for bucket b.
ABSENT = -1
FIRST_BUCKET = -2
