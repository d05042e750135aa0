"""Fetches of an event-driven run that are due, made a few at a time."""

import taichi as ti

from mpp_taichi.contacts._event_spheres import Spheres
from mpp_taichi.prefetch import prefetch

ROOM = 4096  # spheres that can wait to be fetched; a power of two
# A sphere is fetched for each one that is tested for a contact; if more wait than so many, some are beforehand.
ENOUGH, BEFOREHAND = 16, 4


@ti.data_oriented
class Fetches:
    """Spheres whose lines are to be fetched, in a ring.

    A processor has some ten fetches under way, drops those that it is asked for beyond, and takes as long for one of them as
    for the test of a dozen pairs. So they are asked for between such tests.
    """

    def __init__(self, spheres: Spheres, builder: ti.FieldsBuilder, *, is_worthwhile: bool) -> None:
        """Of these spheres, of which none waits; nothing is done if it is not worthwhile."""
        self.spheres, self.is_worthwhile = spheres, is_worthwhile
        self.ring, self.filled, self.done = ti.field(ti.i32), ti.field(ti.i32), ti.field(ti.i32)
        builder.dense(ti.i, ROOM).place(self.ring)
        builder.place(self.filled, self.done)

    @ti.func
    def filled_up_to(self):
        """The place for the next one that `put` is given."""
        return self.filled[None]

    @ti.func
    def put(self, place, i):
        """Sphere i waits at a place, and the next has the place returned; i < 0: nobody, without a branch."""
        self.ring[place] = i
        return (place + ti.cast(i >= 0, ti.i32)) & (ROOM - 1)

    @ti.func
    def fill_up_to(self, place):
        """All that were put before this place wait. If they are more than there is room for, most are forgotten."""
        self.filled[None] = place

    @ti.func
    def take(self, count):
        """From which place on to `fetch` so many, one after the other."""
        done = self.done[None]
        if ti.static(self.is_worthwhile):
            waiting = (self.filled[None] - done) & (ROOM - 1)
            if waiting > ENOUGH:
                for k in ti.static(range(BEFOREHAND)):
                    self.fetch(done + k)
                done += BEFOREHAND
                waiting -= BEFOREHAND
            self.done[None] = (done + ti.min(count, waiting)) & (ROOM - 1)
        return done

    @ti.func
    def fetch(self, place):
        """Who waits there; of places that nobody waits at someone who did, which does no harm."""
        if ti.static(self.is_worthwhile):
            prefetch(self.spheres.clock, ti.max(self.ring[place & (ROOM - 1)], 0))
