"""When each sphere of a sweep had its last contact, for the restitution of the next one."""

import taichi as ti

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.shared.restitution import restitution_after, restitution_at

LONG_AGO = -1e30  # last contact of a sphere that has had none


@ti.data_oriented
class ContactMemory:
    """Times of the last contacts, kept only where the TC model is on.

    before   (n,) of each sphere, from the start of the piece that comes next; at most 0 [time]
    latest   (n,) of the sphere in each slot while its island is played, from the start of this piece [time]
    """

    def __init__(self, setup: ContactSetup) -> None:
        """Allocate; no sphere has had a contact yet."""
        self.contact_time = float(setup.contact_time)
        self.is_kept = self.contact_time > 0.0
        self.before, self.latest = ti.field(float), ti.field(float)
        self._trees = FieldTrees()
        for field in (self.before, self.latest):
            self._trees.place(setup.particle_count if self.is_kept else 1, field)
        self._trees.finish()

    def destroy(self) -> None:
        """Give the memory back."""
        self._trees.destroy()

    def clear(self) -> None:
        """Forget all contacts; to be called once, after all fields are placed."""
        self.before.fill(LONG_AGO)

    @ti.func
    def start(self, k, i):
        """Begin to play the sphere i, which is in slot k."""
        if ti.static(self.is_kept):
            self.latest[k] = self.before[i]

    @ti.func
    def keep(self, k, i, h):
        """End a piece of length h, in which the sphere i in slot k was played."""
        if ti.static(self.is_kept):
            self.before[i] = self.latest[k] - h

    @ti.func
    def pass_by(self, i, h):
        """End a piece of length h, in which sphere i flew freely."""
        if ti.static(self.is_kept):
            self.before[i] = self.before[i] - h

    @ti.func
    def restitution(self, nominal, i, j, t):
        """The e of a contact of slots i and j at time t, which is noted, and 1 if the TC model made it elastic."""
        return restitution_at(t, nominal, i, j, self.latest, self.contact_time)

    @ti.func
    def restitution_without_note(self, nominal, i, second, t):
        """The restitution for slot i and another slot, or a surface, second < 0; the contact is not noted."""
        last = ti.cast(0.0, float)
        if ti.static(self.is_kept):
            last = self.latest[i]
            if second >= 0:
                last = ti.max(last, self.latest[second])
        return restitution_after(nominal, t - last, self.contact_time)

    @ti.func
    def note(self, i, second, t):
        """Note a contact of slot i with another slot, or a surface, second < 0."""
        if ti.static(self.is_kept):
            self.latest[i] = t
            if second >= 0:
                self.latest[second] = t
