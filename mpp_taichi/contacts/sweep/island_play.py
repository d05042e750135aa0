"""Playing an island: the flights and contacts of its spheres within a piece of a drift, event by event."""

import math
from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.contacts.shared.bounce import Bounce
from mpp_taichi.contacts.shared.contact_counts import Tally
from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.shared.loop_watch import LoopWatch
from mpp_taichi.contacts.sweep.drift_planning import Flight
from mpp_taichi.contacts.sweep.islands import Islands
from mpp_taichi.contacts.sweep.slots import Slots
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.device_grid import DeviceGrid
from mpp_taichi.neighbors.partner_list import PartnerList
from mpp_taichi.walls import _geometry

ALL_PAIRS_UP_TO = 300  # spheres; more are faster on the cell grid, see tools/benchmarks/benchmark_contacts.py
MOST_IN_ONE_THREAD = (
    160  # elsewhere than on the CPU; all their pairs are a fifth of the iterations that software Vulkan lets it have
)
LONG_AGO = -1e30  # when a sphere that never touched anything did so last
NOTHING = -1  # partner of a sphere without an event; surface s is -2 - s
LOOK_AGAIN = -1  # stamp of a prediction that says no more than that there is no contact before


@ti.data_oriented
class IslandPlay(Slots):
    """The spheres of a state on their way from contact to contact.

    Another rule for what happens at a contact overrides `resolve`. Spheres are numbered by slots of the cell grid, which are
    near in memory where they are near in space; `index(k)` is the sphere in slot k. While an island is played it is at
    `local_position[k]` at its own `clock[k]`, with `local_velocity[k]`; times count from the start of the piece.
    """

    def __init__(self, setup: ContactSetup, state: Any, *, event_limit: int, all_pairs: bool | None = None) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        n = setup.particle_count
        self.particle_count = n
        self.dimensions = setup.dimensions
        self.state = state
        self.event_limit = event_limit
        few = ALL_PAIRS_UP_TO if on_cpu() else MOST_IN_ONE_THREAD
        self.all_pairs = n <= few if all_pairs is None else all_pairs
        self.bounce = Bounce(setup)  # filled before any field is left to be placed
        self.in_slots = self.keeps_slots and setup.force_free and not self.all_pairs
        self.local_position, self.local_velocity = (ti.Vector.field(self.dimensions, float) for _ in range(2))
        self.clock, self.excursion = ti.field(float), ti.field(float)
        self.best_partner, self.best_stamp, self.stamp = (ti.field(ti.i32) for _ in range(3))
        self.tally = Tally(n, len(self.bounce.surfaces), getattr(state, "wide", ti.f64), placed_by_caller=True)
        local = (self.local_position, self.local_velocity, self.clock, self.excursion, self.tally.summed)
        kind = CellGrid if on_cpu() else DeviceGrid
        self.grid = None if self.all_pairs else kind(n, self.dimensions, setup.enclosure.period, setup.enclosure.origin)
        indices = (self.best_partner, self.best_stamp, self.stamp, self.tally.counted)
        self.islands = Islands(n, local, indices, None if self.grid is None else self.grid.order)
        self.flight = Flight(setup, state)
        self.watch = LoopWatch()
        self.partners = None if self.grid is None else PartnerList(self.grid)
        self.keeps_last_contact = setup.contact_time > 0.0
        self.contact_time = float(setup.contact_time)
        self.shortest_period = self.flight.shortest_period
        self.looks_again = self.all_pairs and self.shortest_period < math.inf
        self.local_last_contact, self.last_contact = ti.field(float), ti.field(float)
        self.touched, self.near = ti.field(ti.i32), ti.field(ti.i32)
        self.violations = ti.field(ti.i32)
        self._trees = FieldTrees()
        self._place_slots(self._trees, self.dimensions)
        for field in (self.touched, self.near):
            self._trees.place(n, integers=[field])
        for field in (self.last_contact, self.local_last_contact):
            self._trees.place(n if self.keeps_last_contact else 1, field)
        self._trees.place(1, integers=[self.violations])
        self._trees.finish()
        self.last_contact.fill(LONG_AGO)

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.bounce, self.islands, self.tally, self.flight, self._trees, self.partners, self.watch, self.grid):
            if part is not None:
                part.destroy()

    def collect(self) -> ContactReport:
        """What was counted since it was last asked."""
        return self.tally.collect()

    @ti.func
    def _time_of_contact(self, i, j, separation, v_i, v_j, horizon):
        reach = self.radius_of(i) + self.radius_of(j)
        return self.bounce.time_of_contact(self.index(i), self.index(j), reach, separation, v_i, v_j, horizon)

    # From contact to contact ---------------------------------------------------------------------------------------------

    @ti.func
    def _see_overlap(self, i, j, separation):
        reach = self.radius_of(i) + self.radius_of(j)
        square = separation.dot(separation)
        if square < reach * reach:
            self.tally.see_overlap(i, (reach - ti.sqrt(square)) / ti.min(self.radius_of(i), self.radius_of(j)))

    @ti.func
    def _first_wall(self, k, time, h):
        """Time of contact with a surface from the state at the start, and -2 - its number; overlaps are noted."""
        result = ti.Vector([ti.math.inf, -1.0])
        for s in ti.static(range(len(self.bounce.surfaces))):
            x = self.start_of(k)
            t = self.bounce.time_of_wall(s, self.index(k), self.radius_of(k), x, self.start_velocity_of(k), time, h)
            gap = _geometry.gap(self.bounce.surfaces[s], x, self.radius_of(k), time)
            if gap < 0.0 and self.radius_of(k) > 0.0:
                self.tally.see_overlap(k, -gap / self.radius_of(k))
            if t < result[0]:
                result = ti.Vector([t, -2.0 - s])
        return result

    @ti.func
    def _play(self, root, time, h):
        """Every event of an island within the drift, in the order of time."""
        begin = self.islands.begin[root]
        size = self.islands.size[root]
        for p in range(size):
            self._start(self.islands.members[begin + p])
        self.islands.start_tournament(root)
        events = 0
        count = 0
        if ti.static(self.looks_again):
            count = size
            for p in range(size):
                self.touched[begin + p] = self.islands.members[begin + p]
        t = h * 0
        playing = True
        while playing:
            for c in range(count):
                self._predict(root, self.touched[begin + c], t, time, h)
            i = self.islands.next(root)
            t = self.islands.best_time[i]
            if not t <= h:
                playing = False
            else:
                count = 1
                self.touched[begin] = i
                if self._is_fresh(i):
                    events += 1
                    if events > self.event_limit:
                        self.tally.fail(root, 1)
                        playing = False
                    else:
                        count = self.resolve(root, i, self.best_partner[i], t, time)
        for p in range(size):
            i = self.islands.members[begin + p]
            self.advance(i, h)
            if ti.static(not self.all_pairs):
                self._check_margin(i)

    @ti.func
    def _start(self, i):
        self.local_position[i] = self.start_of(i)
        self.local_velocity[i] = self.start_velocity_of(i)
        self.clock[i] = 0.0
        self.excursion[i] = 0.0
        self.stamp[i] = 0
        self.near[i] = 0
        self.best_stamp[i] = 0
        self.islands.best_time[i] = self.islands.first_time[i]
        self.best_partner[i] = self.islands.first_partner[i]
        if ti.static(self.keeps_last_contact):
            self.local_last_contact[i] = self.last_contact[self.index(i)]
        self.tally.begin(i)

    @ti.func
    def _is_fresh(self, i):
        """Whether the partner of an event is still on the way it was on when the event was predicted."""
        j = self.best_partner[i]
        result = True
        if j >= 0:
            result = self.stamp[j] == self.best_stamp[i]
        return result

    @ti.func
    def advance(self, i, t):
        """Fly sphere i straight on to time t of the piece."""
        self.local_position[i] = self.local_position[i] + self.local_velocity[i] * (t - self.clock[i])
        self.clock[i] = t
        self.excursion[i] = ti.max(self.excursion[i], (self.local_position[i] - self.start_of(i)).norm())

    @ti.func
    def place_at(self, i, t):
        """Where sphere i of an island is at time t of the piece, if nothing happens to it before."""
        return self.local_position[i] + self.local_velocity[i] * (t - self.clock[i])

    @ti.func
    def resolve(self, root, i, partner, t, time):
        """Let i and its partner (surface s: -2 - s) bounce at time t; returns how many spheres changed their velocities.

        Those are to be listed in `touched`, from `islands.begin[root]` on, with their `stamp` counted up.
        """
        begin = self.islands.begin[root]
        count = 1
        self.advance(i, t)
        self.stamp[i] = self.stamp[i] + 1
        self.touched[begin] = i
        if partner >= 0:
            self.advance(partner, t)
            self.stamp[partner] = self.stamp[partner] + 1
            self.touched[begin + 1] = partner
            count = 2
            self.bounce_pair(ti.min(i, partner), ti.max(i, partner), t)
        else:
            self.bounce_off_wall(i, -2 - partner, t, time)
        return count

    @ti.func
    def bounce_pair(self, i, j, t):
        """Collide two spheres that are at time t, and count it."""
        separation = self.bounce.separation(self.local_position[i], self.local_position[j])
        distance = separation.norm()
        n = separation / distance
        a, b = self.index(i), self.index(j)
        e, elastic = self._restitution(self.bounce.restitution_of(a, b), i, j, t)
        result = self.bounce.pair_impulse(a, b, n, self.local_velocity[j] - self.local_velocity[i], e)
        self.local_velocity[i] = self.local_velocity[i] - result[0] * (self.bounce.inverse_mass_of(a) * n)
        self.local_velocity[j] = self.local_velocity[j] + result[0] * (self.bounce.inverse_mass_of(b) * n)
        self.tally.add_pair(i, result[0], distance, result[1], elastic)
        if not result[0] > 0.0:
            self.tally.fail(i, 1)

    @ti.func
    def bounce_off_wall(self, i, surface, t, time):
        """Reflect a sphere that is at time t off a surface, and count it."""
        n = ti.Vector.zero(float, self.dimensions)
        u = self.local_velocity[i]
        nominal = 1.0
        for s in ti.static(range(len(self.bounce.surfaces))):
            if s == surface:
                n = _geometry.normal(self.bounce.surfaces[s], self.local_position[i], time + t)
                u -= _geometry.surface_velocity(self.bounce.surfaces[s], n)
                nominal = ti.static(self.bounce.surfaces[s].restitution)
        e, elastic = self._restitution(nominal, i, i, t)
        result = self.bounce.wall_impulse(self.index(i), n, u, e)
        self.local_velocity[i] = self.local_velocity[i] + result[0] * (self.bounce.inverse_mass_of(self.index(i)) * n)
        self.tally.add_wall(i, surface, result[0], result[1], elastic)
        if not result[0] > 0.0:
            self.tally.fail(i, 1)

    @ti.func
    def _restitution(self, nominal, i, j, t):
        """E of a contact, 1 shortly after another (TC model), and whether that made it elastic."""
        e = ti.cast(nominal, float)
        elastic = 0
        if ti.static(self.keeps_last_contact):
            since = t - ti.max(self.local_last_contact[i], self.local_last_contact[j])
            if since < self.contact_time and e < 1.0:
                e = 1.0
                elastic = 1
            self.local_last_contact[i] = t
            self.local_last_contact[j] = t
        return e, elastic

    # Predicting --------------------------------------------------------------------------------------------------------

    @ti.func
    def _predict(self, root, i, now, time, h):
        """Find the next event of sphere i, and tell the partners to whom it is the next as well."""
        self.islands.best_time[i] = ti.math.inf
        self.best_partner[i] = NOTHING
        if ti.static(self.all_pairs):
            for j in range(self.particle_count):
                if j != i:
                    self._consider(i, j, now, h)
        else:
            self.visit(i, self._consider_slot, now, h)
        x = self.place_at(i, now)
        for s in ti.static(range(len(self.bounce.surfaces))):
            t = now + self.bounce.time_of_wall(
                s, self.index(i), self.radius_of(i), x, self.local_velocity[i], time + now, h - now
            )
            if t < self.islands.best_time[i]:
                self.islands.best_time[i] = t
                self.best_partner[i] = -2 - s
        self.islands.replay(root, i)

    @ti.func
    def _consider_slot(self, i, j, now, h):
        if self.islands.island[j] == self.islands.island[i]:
            if j != i:
                self._consider(i, j, now, h)
        elif self.islands.island[j] >= 0:
            if self._may_meet(i, j):
                self.near[i] = 1
        else:
            v = self.start_velocity[j]
            d = self.bounce.separation(self.place_at(i, now), self.start_position[j] + v * now)
            if self._time_of_contact(i, j, d, self.local_velocity[i], v, h - now) <= h - now:
                self.join(i, j)

    @ti.func
    def join(self, k, other):
        """Wish that k and other be in one island when it is played again."""
        self.islands.link(k, other, ti.math.inf)

    @ti.func
    def _may_meet(self, i, j):
        """Whether the margins of two spheres, which no flight leaves, meet."""
        separation = self.bounce.separation(self.start_position[i], self.start_position[j])
        together = self.start_reach[i] + self.start_reach[j]
        return separation.norm_sqr() <= together * together

    @ti.func
    def _consider(self, i, j, now, h):
        """A contact of i with j of the same island may be the next of i, or of j."""
        d = self.bounce.separation(self.place_at(i, now), self.place_at(j, now))
        v_i, v_j = self.local_velocity[i], self.local_velocity[j]
        horizon = h - now
        if ti.static(self.looks_again):
            horizon = ti.min(horizon, self._sight(i, j, (v_j - v_i).norm()))
        t = now + self._time_of_contact(i, j, d, v_i, v_j, horizon)
        stamp_i, stamp_j = self.stamp[i], self.stamp[j]
        if ti.static(self.looks_again):
            if t > h and horizon < h - now:
                t = now + horizon
                stamp_i, stamp_j = LOOK_AGAIN, LOOK_AGAIN
        if self._is_sooner(t, j, i):
            self.islands.best_time[i] = t
            self.best_partner[i] = j
            self.best_stamp[i] = stamp_j
        if self._is_sooner(t, i, j):
            self.islands.best_time[j] = t
            self.best_partner[j] = i
            self.best_stamp[j] = stamp_i
            self.islands.replay(self.islands.island[j], j)

    @ti.func
    def _is_sooner(self, t, partner, i):
        """Whether a contact with a partner comes before what is next for i; at one time spheres come by number."""
        result = t < self.islands.best_time[i]
        if t == self.islands.best_time[i]:
            result = t < ti.math.inf and self.islands.number(partner) < self.islands.number(self.best_partner[i])
        return result

    @ti.func
    def _sight(self, i, j, speed):
        """How long no other image of j can reach i than the nearest of now; all pairs of a periodic box look again then."""
        return (self.shortest_period / 2.0 - self.radius_of(i) - self.radius_of(j)) / speed

    @ti.func
    def _check_margin(self, k):
        if self.excursion[k] > self.start_reach[k] - self.start_radius[k]:
            self.flight.remember(self.index(k), self.excursion[k])
            self.violations[0] = 1

    @ti.func
    def _keep(self, chunk, k, h):
        i = self.index(k)
        if ti.static(self.in_slots):
            self.start_position[k] = self.local_position[k]
            self.start_velocity[k] = self.local_velocity[k]
        else:
            self.state.position[i] = self.local_position[k]
            self.state.velocity[i] = self.local_velocity[k]
        self.tally.keep(chunk, k)
        if ti.static(self.keeps_last_contact):
            self.last_contact[i] = self.local_last_contact[k] - h
