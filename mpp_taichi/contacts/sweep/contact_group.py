"""The contacts of a group, which touch at one instant, and how an impulse at one changes the speeds at the others."""

import taichi as ti

from mpp_taichi.arithmetic.round_off import round_off
from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.shared.impulse import impulse_between, pushed
from mpp_taichi.types import Template

ROUND_OFF = 64  # roundings that a relative speed may have gathered; a slower approach counts as no approach


@ti.data_oriented
class ContactGroup:
    """Rows c = 0 … count − 1: a sphere `first[c]` that touches `second[c]`, another sphere or, as −1 − s, surface s.

    normal         unit vector from second to first
    restitution    e of the contact
    surface_speed  n·(velocity of the surface) [length / time]; 0 between spheres
    impulse        sum of the impulses that were given along the normal since the row was set [momentum]
    lost           kinetic energy that these impulses took, relative to surfaces [energy]
    hits           number of these impulses
    made_elastic   1 where e is 1 because the contact follows another one within the contact time

    The separating speed of a contact is n·(v_first − v_second), negative where it approaches.
    """

    def __init__(self, setup: ContactSetup, capacity: int):
        """Allocate for `capacity` contacts of the spheres of `setup`."""
        self.dimensions = setup.dimensions
        self.capacity = max(capacity, 1)
        self.particle_count = setup.particle_count
        # Rounding unit of the precision, and the speed, relative to the largest, below which a contact does not approach.
        self.epsilon = 2.0 * round_off()
        self.threshold = ROUND_OFF * self.epsilon
        self._trees = FieldTrees()
        self.inverse_mass = ti.Vector.field(self.dimensions, float)
        self._trees.place(self.particle_count, self.inverse_mass)
        self.first, self.second, self.hits, self.made_elastic = (ti.field(ti.i32) for _ in range(4))
        self.normal = ti.Vector.field(self.dimensions, float)
        self.restitution, self.surface_speed, self.impulse, self.lost = (ti.field(float) for _ in range(4))
        for row in (self.first, self.second, self.hits, self.made_elastic):
            self._trees.place(self.capacity, integers=[row])
        for row in (self.normal, self.restitution, self.surface_speed, self.impulse, self.lost):
            self._trees.place(self.capacity, row)
        self._trees.finish()
        kind = self.inverse_mass.to_numpy().dtype
        self.inverse_mass.from_numpy(setup.inverse_mass[:, : self.dimensions].astype(kind))

    def destroy(self) -> None:
        """Give the memory back."""
        self._trees.destroy()

    @ti.func
    def set_row(self, c, first, second, normal, surface_speed, restitution, made_elastic):
        """Write row c, a contact that has had no impulse yet."""
        self.first[c] = first
        self.second[c] = second
        self.normal[c] = normal
        self.surface_speed[c] = surface_speed
        self.restitution[c] = restitution
        self.made_elastic[c] = made_elastic
        self.impulse[c] = 0.0
        self.lost[c] = 0.0
        self.hits[c] = 0

    @ti.func
    def separating_speed(self, state: Template, c):
        """n·(v_first − v_second), negative where the two approach [length / time]."""
        relative = state.velocity[self.first[c]]
        if self.second[c] >= 0:
            relative -= state.velocity[self.second[c]]
        return self.normal[c].dot(relative) - self.surface_speed[c]

    @ti.func
    def speed_scale(self, state: Template, count):
        """Largest speed in the group, to which round-off is relative [length / time]."""
        largest = ti.cast(0.0, float)
        for c in range(count):
            largest = ti.max(largest, state.velocity[self.first[c]].norm(), ti.abs(self.surface_speed[c]))
            if self.second[c] >= 0:
                largest = ti.max(largest, state.velocity[self.second[c]].norm())
        return largest

    @ti.func
    def coupling(self, c, d):
        """Change of the separating speed of c by a unit impulse along the normal of d [1 / mass]."""
        n = self.normal[c]
        m = self.normal[d]
        result = ti.cast(0.0, float)
        i, j = self.first[c], self.second[c]
        other_i, other_j = self.first[d], self.second[d]
        if i == other_i:
            result += n.dot(self.inverse_mass[i] * m)
        if i == other_j:
            result -= n.dot(self.inverse_mass[i] * m)
        if j >= 0:
            if j == other_i:
                result -= n.dot(self.inverse_mass[j] * m)
            if j == other_j:
                result += n.dot(self.inverse_mass[j] * m)
        return result

    @ti.func
    def bounce(self, state: Template, c, e):
        """Let the spheres of a contact bounce as if it were alone, with the restitution e."""
        n = self.normal[c]
        i, j = self.first[c], self.second[c]
        other_velocity, other_inverse_mass = n * self.surface_speed[c], ti.Vector.zero(float, self.dimensions)
        if j >= 0:
            other_velocity, other_inverse_mass = state.velocity[j], self.inverse_mass[j]
        found = impulse_between(n, state.velocity[i], other_velocity, self.inverse_mass[i], other_inverse_mass, e)
        self.push(state, c, found[0], found[1], found[2])

    @ti.func
    def push(self, state: Template, c, impulse, impulse_low, lost):
        """Give both spheres of a contact an impulse along its normal, of two parts, which takes the energy `lost`."""
        n = self.normal[c]
        i, j = self.first[c], self.second[c]
        state.velocity[i] = pushed(state.velocity[i], self.inverse_mass[i], n, impulse, impulse_low, 1)
        if j >= 0:
            state.velocity[j] = pushed(state.velocity[j], self.inverse_mass[j], n, impulse, impulse_low, -1)
        self.impulse[c] = self.impulse[c] + impulse
        self.lost[c] = self.lost[c] + lost
        self.hits[c] = self.hits[c] + 1
