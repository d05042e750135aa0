"""The spheres of an island while the island is played: each at its own time, with its next event."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.particle_update import drifted
from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.sweep.slots import Slots

NOTHING = -1  # partner of a sphere without an event; the partner number of surface s is −2 − s


@ti.data_oriented
class PlayedSpheres:
    """Straight flights of spheres from contact to contact, by slots; times count from the start of the piece.

    position       (n,) where the sphere was at its own `clock` [length]
    velocity       (n,) [length / time]
    clock          (n,) time of its last contact, or 0 [time]
    excursion      (n,) largest distance from its start that it has reached at a contact [length]
    best_partner   (n,) partner of its next event: a slot, −2 − s for surface s, or NOTHING
    best_stamp     (n,) stamp of the partner when the event was predicted
    stamp          (n,) number of its contacts; an event whose partner has another stamp by now is stale
    near           (n,) 1: it came near a sphere of another island, so that the two islands may have to be joined
    touched        spheres whose velocities an event has changed, from the first place of their island on
    """

    def __init__(self, setup: ContactSetup, slots: Slots) -> None:
        """Declare the fields; the fields of `numbers` and `integers` are placed later, beside the fields of the islands."""
        self.slots = slots
        self.position, self.velocity = (ti.Vector.field(setup.dimensions, float) for _ in range(2))
        self.clock, self.excursion = ti.field(float), ti.field(float)
        self.best_partner, self.best_stamp, self.stamp = (ti.field(ti.i32) for _ in range(3))
        self.near, self.touched = ti.field(ti.i32), ti.field(ti.i32)
        self._trees = FieldTrees()
        for field in (self.touched, self.near):
            self._trees.place(setup.particle_count, integers=[field])
        self._trees.finish()

    @property
    def numbers(self) -> tuple[Any, ...]:
        """Fields of floats that an event reads."""
        return self.position, self.velocity, self.clock, self.excursion

    @property
    def integers(self) -> tuple[Any, ...]:
        """Fields of integers that an event reads."""
        return self.best_partner, self.best_stamp, self.stamp

    def destroy(self) -> None:
        """Give the memory back."""
        self._trees.destroy()

    @ti.func
    def start(self, i, partner):
        """Put sphere i at the start of the piece, with the partner of its first event."""
        self.position[i] = self.slots.start_of(i)
        self.velocity[i] = self.slots.start_velocity_of(i)
        self.clock[i] = 0.0
        self.excursion[i] = 0.0
        self.stamp[i] = 0
        self.near[i] = 0
        self.best_stamp[i] = 0
        self.best_partner[i] = partner

    @ti.func
    def is_fresh(self, i):
        """Whether the partner of the next event of sphere i has had no contact since the event was predicted."""
        j = self.best_partner[i]
        result = True
        if j >= 0:
            result = self.stamp[j] == self.best_stamp[i]
        return result

    @ti.func
    def advance(self, i, t):
        """Fly sphere i straight on to time t of the piece."""
        self.position[i] = drifted(self.position[i], self.velocity[i], t - self.clock[i])
        self.clock[i] = t
        self.excursion[i] = ti.max(self.excursion[i], (self.position[i] - self.slots.start_of(i)).norm())

    @ti.func
    def place_at(self, i, t):
        """Position of sphere i at time t of the piece, if it has no contact before."""
        return drifted(self.position[i], self.velocity[i], t - self.clock[i])
