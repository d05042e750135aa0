"""Collisions of an event-driven run: the change of velocities at a contact, and the counts."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.round_off import round_off
from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.contacts.events.cells import EventCells
from mpp_taichi.contacts.events.deviation import Deviation
from mpp_taichi.contacts.events.spheres import FlyingSpheres
from mpp_taichi.contacts.shared.impulse import impulse_between, pushed
from mpp_taichi.contacts.shared.restitution import restitution_after
from mpp_taichi.contacts.shared.thermal_bounce import off_wall
from mpp_taichi.walls._surfaces import WallSurfaces

# Contacts in a row of one sphere at the same floating-point time. More inelastic contacts than this are an inelastic
# collapse; the number of elastic contacts is bounded by the number of touching spheres.
STALLED_INELASTIC = 16
STALLED_ELASTIC = 1000
ROUNDINGS = 4.0
"""Roundings of a place by which a contact with a wall takes a sphere out of the wall, where round-off left it."""


@ti.data_oriented
class Collision:
    """Impulses along the normal, and sums over them."""

    def __init__(
        self,
        setup: ContactSetup,
        spheres: FlyingSpheres,
        cells: EventCells,
        walls: WallSurfaces,
        builder: Any,
        *,
        deviation: Deviation | None,
    ) -> None:
        """Place the fields, for the spheres of a setup in their cells, between walls; sums begin at 0."""
        self.spheres, self.cells, self.walls = spheres, cells, walls
        self.deviation, self.follows_deviation = deviation, deviation is not None
        self.contact_time = float(setup.contact_time)
        self.rounding = ROUNDINGS * round_off()
        wide = spheres.wide
        self.pair_count, self.wall_count, self.elastic_count = (ti.field(ti.i32) for _ in range(3))
        self.unresolved = ti.field(ti.i32)
        self.virial, self.dissipated, self.overlap = (ti.field(wide) for _ in range(3))
        self.wall_impulse = ti.field(wide)
        self.impulse = ti.field(float)
        self.table = ti.field(float)
        builder.place(self.pair_count, self.wall_count, self.elastic_count, self.unresolved)
        builder.place(self.overlap)
        builder.dense(ti.i, 1).place(self.virial, self.dissipated)
        builder.place(self.impulse)
        builder.dense(ti.i, max(walls.account_count, 1)).place(self.wall_impulse)
        self.sum_fields = (self.virial, self.dissipated, self.wall_impulse)
        self._before = ContactReport()
        builder.dense(ti.ij, np.asarray(setup.restitution).shape).place(self.table)

    def write(self, setup: ContactSetup) -> None:
        """Fill the table of restitutions."""
        real = np.float32 if self.table.dtype == ti.f32 else np.float64
        self.table.from_numpy(np.array(setup.restitution, dtype=real))

    def contacts(self) -> int:
        """Number of contacts since the last `collect`."""
        return int(self.pair_count[None]) + int(self.wall_count[None])

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        now = ContactReport(
            pair_count=self.pair_count[None],
            wall_count=self.wall_count[None],
            elastic_count=self.elastic_count[None],
            virial=self.virial[0],
            wall_impulse=tuple(self.wall_impulse.to_numpy()[: self.walls.account_count].tolist()),
            dissipated_energy=self.dissipated[0],
            largest_overlap=self.overlap[None],
            unresolved=self.unresolved[None],
        )
        for field in (self.pair_count, self.wall_count, self.elastic_count, self.unresolved):
            field[None] = 0
        self.overlap[None] = 0.0
        since, self._before = now.sums_since(self._before), now
        return since

    @ti.func
    def pair(self, i, j, time):
        """Let two spheres bounce at `time`, with the impulse of `impulse_between`; returns whether time still goes on."""
        last = ti.max(self._last_contact(i), self._last_contact(j))
        self._begin(i, time)
        self._begin(j, time)
        q = self.cells.nearest_image(self.spheres.position[i] - self.spheres.position[j])
        distance = q.norm()
        n = q / distance
        v_i, v_j = self.spheres.velocity[i], self.spheres.velocity[j]
        w_i, w_j = self.spheres.inverse_mass(i), self.spheres.inverse_mass(j)
        speed, softness = n.dot(v_i - v_j), (n * n).dot(w_i + w_j)
        nominal = self.table[self.spheres.material[i], self.spheres.material[j]]
        e, elastic = restitution_after(nominal, time - last, self.contact_time)
        self._count_elastic(elastic)
        self.impulse[None] = 0.0
        self._note_overlap(
            self.spheres.radius(i) + self.spheres.radius(j) - distance, ti.min(self.spheres.radius(i), self.spheres.radius(j))
        )
        if speed < 0 and softness > 0:
            found = impulse_between(n, v_i, v_j, w_i, w_j, e)
            impulse, lost = found[0], found[2]
            if ti.static(self.follows_deviation):
                self.deviation.pair(i, j, n, distance, impulse)
            self.spheres.velocity[i] = pushed(v_i, w_i, n, impulse, found[1], 1)
            self.spheres.velocity[j] = pushed(v_j, w_j, n, impulse, found[1], -1)
            self.pair_count[None] += 1
            self.virial[0] += ti.cast(impulse * distance, self.spheres.wide)
            self.dissipated[0] += ti.cast(lost, self.spheres.wide)
            self.impulse[None] = impulse
        goes_on = self._note_contact(i, j, e)
        return self._note_contact(j, i, e) and goes_on

    @ti.func
    def wall(self, i, w, time):
        """Let sphere i bounce off surface w at `time`; returns whether time still goes on."""
        last = self._last_contact(i)
        self._begin(i, time)
        x, now = self.spheres.position[i], ti.cast(time, float)
        gap, n, velocity, nominal, account = self.walls.touched(w, x, self.spheres.radius(i), now)
        e, elastic = restitution_after(nominal, time - last, self.contact_time)
        self._count_elastic(elastic)
        v, inverse_mass = self.spheres.velocity[i], self.spheres.inverse_mass(i)
        if gap < 0:
            back = ti.min(-gap, ti.static(self.rounding) * (x.norm() + self.spheres.radius(i)))
            self.spheres.position[i] = x + back * ti.select(inverse_mass > 0, n, 0 * n)
        speed, softness = n.dot(v - velocity), (n * n).dot(inverse_mass)
        self._note_overlap(-gap, self.spheres.radius(i))
        self.impulse[None] = 0.0
        if speed < 0 and softness > 0:
            found = impulse_between(n, v, velocity, inverse_mass, ti.Vector.zero(float, self.spheres.dimensions), e)
            if ti.static(self.follows_deviation):
                self.deviation.wall(i, w, n, velocity, found[0], now)
            after, impulse, lost = off_wall(self.walls, w, i, n, v, velocity, inverse_mass, found, now)
            self.spheres.velocity[i] = after
            self.wall_count[None] += 1
            self.wall_impulse[account] += ti.cast(impulse, self.spheres.wide)
            self.dissipated[0] += ti.cast(lost, self.spheres.wide)
            self.impulse[None] = impulse
        return self._note_contact(i, -1 - w, e)

    @ti.func
    def _count_elastic(self, elastic):
        if ti.static(self.contact_time > 0):
            self.elastic_count[None] += elastic

    @ti.func
    def _last_contact(self, i):
        """Time of the last contact of sphere i, which is its clock; −infinity if it has had none."""
        result = ti.cast(-ti.math.inf, self.spheres.wide)
        if self.spheres.contacts[i] != 0:
            result = self.spheres.clock[i]
        return result

    @ti.func
    def _begin(self, i, time):
        """Bring sphere i to the time of a contact; `stalled` counts contacts in a row at one time."""
        if time > self._last_contact(i):
            self.spheres.stalled[i] = 0
        else:
            self.spheres.stalled[i] += 1
        x, v = self.spheres.position_at(i, time), self.spheres.velocity_at(i, time)
        if ti.static(self.follows_deviation):
            self.deviation.fly(i, ti.cast(time - self.spheres.clock[i], float))
        self.spheres.position[i], self.spheres.velocity[i] = x, v
        self.spheres.clock[i] = time

    @ti.func
    def _note_overlap(self, depth, radius):
        if depth > 0 and radius > 0:
            self.overlap[None] = ti.max(self.overlap[None], ti.cast(depth / radius, self.spheres.wide))

    @ti.func
    def _note_contact(self, i, partner, e):
        """Note a contact of sphere i; returns False if it has had too many contacts in a row at one time."""
        self.spheres.last_partner[i] = partner
        self.spheres.contacts[i] += 1
        limit = STALLED_INELASTIC if e < 1 else ti.static(STALLED_ELASTIC + 2 * self.spheres.count)
        return self.spheres.stalled[i] <= limit
