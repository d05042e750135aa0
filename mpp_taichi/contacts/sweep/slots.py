"""Slots of the cell grid: where the spheres are when a piece of a drift begins."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.shared.bounce import Bounce
from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.sweep.drift_planning import MotionSummary


@ti.data_oriented
class Slots:
    """Position, velocity, radius and reach of each sphere at the start of a piece, by slots of the cell grid.

    Slots that are near in memory hold spheres that are near in space; `index(k)` is the sphere in slot k. Few spheres, whose
    pairs are all tested, need no grid: there slot k is sphere k, and the state is read instead of these fields.

    Where nothing but contacts changes the motion (`ContactSetup.force_free`) the spheres can stay in their slots from one drift
    to the next, and the state is written only when it is asked for. Else the spheres are copied from the state before each
    piece.

    stay     whether the spheres stay in their slots after a drift
    holds    whether the slots hold the present positions and velocities
    leads    whether the slots hold them and the state does not yet
    motion   summary of the motion of the spheres in the slots, or None
    """

    def __init__(self, setup: ContactSetup, state: Any, bounce: Bounce, order: Any, *, stay: bool) -> None:
        """Allocate for the spheres of `setup`; `order` of the cell grid says which sphere is in a slot, None without a grid."""
        self.particle_count = setup.particle_count
        self.state, self.bounce, self.order = state, bounce, order
        self.all_pairs = order is None
        self.stay = stay
        self.holds = self.leads = False
        self.motion: MotionSummary | None = None
        self.position, self.velocity = (ti.Vector.field(setup.dimensions, float) for _ in range(2))
        self.radius, self.reach = ti.field(float), ti.field(float)
        self._trees = FieldTrees()
        # Together in one tree, whose first entry begins a line of the cache: in f64 and three dimensions a sphere fills a line.
        self._trees.place(1 if self.all_pairs else setup.particle_count, self.position, self.velocity, self.radius, self.reach)
        self._trees.finish()

    def destroy(self) -> None:
        """Give the memory back."""
        self._trees.destroy()

    # Reading a slot

    @ti.func
    def index(self, k):
        """The sphere that is in slot k."""
        result = k
        if ti.static(not self.all_pairs):
            result = self.order[k]
        return result

    @ti.func
    def radius_of(self, k):
        """Radius of the sphere in slot k [length]."""
        return self.bounce.radius[k] if ti.static(self.all_pairs) else self.radius[k]

    @ti.func
    def start_of(self, k):
        """Position of the sphere in slot k at the start of the piece."""
        return self.state.position[k] if ti.static(self.all_pairs) else self.position[k]

    @ti.func
    def start_velocity_of(self, k):
        """Velocity of the sphere in slot k at the start of the piece."""
        return self.state.velocity[k] if ti.static(self.all_pairs) else self.velocity[k]

    @ti.func
    def time_of_contact(self, i, j, separation, v_i, v_j, horizon):
        """When the spheres in slots i and j, `separation` apart, meet in straight flight: 0 … horizon from now, or infinity."""
        reach = self.radius_of(i) + self.radius_of(j)
        return self.bounce.time_of_contact(self.index(i), self.index(j), reach, separation, v_i, v_j, horizon)

    @ti.func
    def margins_meet(self, i, j):
        """Whether the balls of radius `reach` around the starts of two spheres meet; no sphere leaves its ball in the piece."""
        separation = self.bounce.separation(self.position[i], self.position[j])
        together = self.reach[i] + self.reach[j]
        return separation.norm_sqr() <= together * together

    # Copying from the state, and back

    @ti.kernel
    def take_radii(self):
        """Copy the radii, after the grid has sorted the spheres of the state."""
        for k in range(self.particle_count):
            self.radius[k] = self.bounce.radius[self.order[k]]

    def keep(self, motion: MotionSummary) -> None:
        """Note that the slots hold the spheres after a piece, and how these move."""
        self.motion = motion
        self.holds = self.leads = True

    def forget(self) -> None:
        """Note that the state was changed from outside, so that the slots no longer hold the spheres."""
        self.holds = self.leads = False
        self.motion = None

    def write_back(self) -> None:
        """Bring positions and velocities of the state up to date, where only the slots hold them."""
        if self.leads:
            self._write_back()
            self.leads = False

    @ti.kernel
    def _write_back(self):
        for k in range(self.particle_count):
            i = self.order[k]
            self.state.position[i] = self.position[k]
            self.state.velocity[i] = self.velocity[k]
