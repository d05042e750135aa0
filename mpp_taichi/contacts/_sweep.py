"""Drift with exact contacts: straight flights, and every contact on the way at its time and in its order.

Spheres whose predicted contacts lie within the drift form islands; an island is played through event by event, and
islands in parallel. Where a sphere leaves a contact towards a sphere outside, the two islands are joined and played
again from the start of the drift, until nothing joins: the result is that of one queue of all events, to round-off.
Few spheres are one island from the beginning. Nothing depends on the number of threads.
"""

import math
from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.contacts._bounce import Bounce
from mpp_taichi.contacts._flight import Flight, Piece
from mpp_taichi.contacts._islands import Islands
from mpp_taichi.contacts._tally import CHUNKS, SMALLEST_BLOCK, Tally
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.walls import _geometry

ALL_PAIRS_UP_TO = 400  # spheres; more are faster on the cell grid, see tools/benchmark_contacts.py
LONG_AGO = -1e30  # when a sphere that never touched anything did so last
NOTHING = -1  # partner of a sphere without an event; surface s is -2 - s
LOOK_AGAIN = -1  # stamp of a prediction that says no more than that there is no contact before
TRIES = 64  # with wider margins, then with shorter pieces


@ti.data_oriented
class Sweep:
    """The spheres of a state, moved along their velocities from contact to contact.

    Another rule for what happens at a contact overrides `resolve`. Spheres are numbered by slots of the cell grid, which are near
    in memory where they are near in space; `index(k)` is the sphere in slot k. While an island is played it is at
    `local_position[k]` at its own `clock[k]`, with `local_velocity[k]`; times count from the start of the piece.
    """

    def __init__(self, setup: ContactSetup, state: Any, *, event_limit: int, all_pairs: bool | None = None) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        n = setup.particle_count
        self.particle_count = n
        self.dimensions = setup.dimensions
        self.state = state
        self.event_limit = event_limit
        self.all_pairs = n <= ALL_PAIRS_UP_TO if all_pairs is None else all_pairs
        self.local_position, self.local_velocity = (ti.Vector.field(self.dimensions, float) for _ in range(2))
        self.clock, self.excursion = ti.field(float), ti.field(float)
        self.best_partner, self.best_stamp, self.stamp, self.near = (ti.field(ti.i32) for _ in range(4))
        local = (self.local_position, self.local_velocity, self.clock, self.excursion)
        self.islands = Islands(n, (*local, self.best_partner, self.best_stamp, self.stamp, self.near))
        self.bounce = Bounce(setup)
        self.tally = Tally(n, len(self.bounce.surfaces), getattr(state, "wide", ti.f64))
        self.flight = Flight(setup, state)
        self.grid = None if self.all_pairs else CellGrid(n, self.dimensions, setup.enclosure.period, setup.enclosure.origin)
        self.keeps_last_contact = setup.contact_time > 0.0
        self.contact_time = float(setup.contact_time)
        self.shortest_period = self.flight.shortest_period
        self.looks_again = self.all_pairs and self.shortest_period < math.inf
        self.local_last_contact, self.last_contact = ti.field(float), ti.field(float)
        self.touched = ti.field(ti.i32)
        self.violations = ti.field(ti.i32)
        self.start_position, self.start_velocity = (ti.Vector.field(self.dimensions, float) for _ in range(2))
        self.start_radius = ti.field(float)
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, n).place(self.touched)
        sorted_count = 1 if self.all_pairs else n
        builder.dense(ti.i, sorted_count).place(self.start_position, self.start_velocity, self.start_radius)
        for field in (self.last_contact, self.local_last_contact):
            builder.dense(ti.i, n if self.keeps_last_contact else 1).place(field)
        builder.dense(ti.i, 1).place(self.violations)
        self._tree = builder.finalize()
        self.last_contact.fill(LONG_AGO)

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.bounce, self.islands, self.tally, self.flight, self._tree, self.grid):
            if part is not None:
                part.destroy()

    def collect(self) -> ContactReport:
        """What was counted since it was last asked."""
        return self.tally.collect()

    # A drift -----------------------------------------------------------------------------------------------------------

    def drift(self, time: float, h: float) -> None:
        """Move all spheres by h along their velocities, contacts resolved on the way."""
        if self.all_pairs:
            self._drift_serial(time, h)
        else:
            done = 0.0
            while done < h:
                done += self._drift_piece(time + done, h - done)

    @ti.kernel
    def _drift_serial(self, time: float, h: float):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.drift_serial(time, h)

    @ti.func
    def drift_serial(self, time, h):
        """The same inside a serialized loop of another kernel, where `all_pairs` is true."""
        self.islands.everything()
        for i in range(self.particle_count):
            wall = self._first_wall(i, time, h)
            self.islands.first_time[i] = wall[0]
            self.islands.first_partner[i] = ti.cast(wall[1], ti.i32)
        for i in range(self.particle_count):
            for j in range(i + 1, self.particle_count):
                self._offer_first(i, j, h)
        self._play(0, time, h)
        for i in range(self.particle_count):
            self._keep(0, i, h)

    @ti.func
    def _offer_first(self, i, j, h):
        """Note the first contact of a pair from the state at the start."""
        separation = self.bounce.separation(self.start_of(i), self.start_of(j))
        self._see_overlap(i, j, separation)
        if ti.static(not self.looks_again):
            t = self._time_of_contact(i, j, separation, self.start_velocity_of(i), self.start_velocity_of(j), h)
            if t < self.islands.first_time[i]:
                self.islands.first_time[i] = t
                self.islands.first_partner[i] = j
            if t < self.islands.first_time[j]:
                self.islands.first_time[j] = t
                self.islands.first_partner[j] = i

    def _drift_piece(self, time: float, rest: float) -> float:
        """A piece of a drift of many spheres; returns how long it was."""
        piece = self.flight.plan(rest)
        for _ in range(TRIES):
            self.grid.build(self.state.position, self.flight.reach, piece.bounds)
            self._search(time, piece.h)
            links = self.islands.count[self.islands.LINKS]
            if links > self.islands.capacity or self.flight.is_crowded(piece, links):
                piece = self.flight.shorten(piece)
            elif self._play_until_nothing_joins(time, piece.h) == 0:
                break
            else:
                piece = self.flight.widen(piece)
        else:
            self._give_up()
        self._commit(piece.h)
        return piece.h

    def _play_until_nothing_joins(self, time: float, h: float) -> int:
        """Number of spheres that left the margin within which their partners were looked for."""
        while True:
            joins, violations = self._play_islands(time, h)
            if joins == 0 or violations > 0:
                return violations

    @ti.kernel
    def _give_up(self):
        self.tally.give_up(ti.max(self.violations[0], 1))

    # Slots -------------------------------------------------------------------------------------------------------------

    @ti.func
    def index(self, k):
        """Which sphere is in slot k."""
        result = k
        if ti.static(not self.all_pairs):
            result = self.grid.order[k]
        return result

    @ti.func
    def radius_of(self, k):
        """Radius of the sphere in slot k; of the following too."""
        return self.bounce.radius[k] if ti.static(self.all_pairs) else self.start_radius[k]

    @ti.func
    def start_of(self, k):
        """Position at the start of the piece."""
        return self.state.position[k] if ti.static(self.all_pairs) else self.start_position[k]

    @ti.func
    def start_velocity_of(self, k):
        """Velocity at the start of the piece."""
        return self.state.velocity[k] if ti.static(self.all_pairs) else self.start_velocity[k]

    @ti.func
    def _time_of_contact(self, k, l, separation, v_k, v_l, horizon):
        reach = self.radius_of(k) + self.radius_of(l)
        return self.bounce.time_of_contact(self.index(k), self.index(l), reach, separation, v_k, v_l, horizon)

    # Looking for first contacts ----------------------------------------------------------------------------------------

    @ti.kernel
    def _search(self, time: float, h: float):
        ti.loop_config(serialize=True)
        for k in range(1):
            self.islands.count[self.islands.LINKS] = 0
            self.islands.count[self.islands.PENDING] = 0
            self.violations[0] = 0
        for k in range(self.particle_count):
            i = self.grid.order[k]
            self.start_position[k] = self.state.position[i]
            self.start_velocity[k] = self.state.velocity[i]
            self.start_radius[k] = self.bounce.radius[i]
            self.islands.parent[k] = -1
            self.islands.island[k] = -1
        for k in range(self.particle_count):
            self.grid.visit_later(k, self._see_pair, time, h)
            wall = self._first_wall(k, time, h)
            if wall[0] <= h:
                self.islands.link(k, ti.cast(wall[1], ti.i32), wall[0])

    @ti.func
    def _see_pair(self, k, l, time, h):
        separation = self.bounce.separation(self.start_position[k], self.start_position[l])
        self._see_overlap(k, l, separation)
        t = self._time_of_contact(k, l, separation, self.start_velocity[k], self.start_velocity[l], h)
        if t <= h:
            self.islands.link(k, l, t)

    @ti.func
    def _see_overlap(self, k, l, separation):
        reach = self.radius_of(k) + self.radius_of(l)
        square = separation.dot(separation)
        if square < reach * reach:
            self.tally.see_overlap((reach - ti.sqrt(square)) / ti.min(self.radius_of(k), self.radius_of(l)))

    @ti.func
    def _first_wall(self, k, time, h):
        """Time of contact with a surface from the state at the start, and -2 - its number; overlaps are noted."""
        result = ti.Vector([ti.math.inf, -1.0])
        for s in ti.static(range(len(self.bounce.surfaces))):
            x = self.start_of(k)
            t = self.bounce.time_of_wall(s, self.index(k), self.radius_of(k), x, self.start_velocity_of(k), time, h)
            gap = _geometry.gap(self.bounce.surfaces[s], x, self.radius_of(k), time)
            if gap < 0.0 and self.radius_of(k) > 0.0:
                self.tally.see_overlap(-gap / self.radius_of(k))
            if t < result[0]:
                result = ti.Vector([t, -2.0 - s])
        return result

    # Playing islands ---------------------------------------------------------------------------------------------------

    @ti.kernel
    def _play_islands(self, time: float, h: float) -> ti.types.vector(2, ti.i32):
        ti.loop_config(serialize=True)
        for k in range(1):
            self.islands.form()
        for k in range(self.islands.count[self.islands.PENDING]):
            self._play(self.islands.pending[k], time, h)
        for k in range(self.islands.count[self.islands.INVOLVED]):
            i = self.islands.involved[k]
            if self.near[i] == 1:
                self.grid.visit(i, self._see_other_island, h, h)
        return ti.Vector([self.islands.count[self.islands.LINKS], self.violations[0]])

    @ti.func
    def _see_other_island(self, k, l, h, _):
        """Join two islands where spheres may have met: neither left a ball around its start, and the balls meet."""
        if self.islands.island[l] >= 0 and self.islands.island[l] != self.islands.island[k]:
            separation = self.bounce.separation(self.start_position[k], self.start_position[l])
            reach = self.radius_of(k) + self.radius_of(l) + self.excursion[k] + self.excursion[l]
            if separation.dot(separation) <= reach * reach:
                self.islands.link(k, l, ti.math.inf)

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
                        self.tally.give_up(1)
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
        self.local_velocity[i] = self.local_velocity[i] - result[0] * (self.bounce.inverse_mass[a] * n)
        self.local_velocity[j] = self.local_velocity[j] + result[0] * (self.bounce.inverse_mass[b] * n)
        self.tally.add_pair(i, result[0], distance, result[1], elastic)
        if not result[0] > 0.0:
            self.tally.give_up(1)

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
        self.local_velocity[i] = self.local_velocity[i] + result[0] * (self.bounce.inverse_mass[self.index(i)] * n)
        self.tally.add_wall(i, surface, result[0], result[1], elastic)
        if not result[0] > 0.0:
            self.tally.give_up(1)

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
            self.grid.visit(i, self._consider_slot, now, h)
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
            self.near[i] = 1
        else:
            v = self.start_velocity[j]
            d = self.bounce.separation(self.place_at(i, now), self.start_position[j] + v * now)
            if self._time_of_contact(i, j, d, self.local_velocity[i], v, h - now) <= h - now:
                self.islands.link(i, j, ti.math.inf)

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
        if t < self.islands.best_time[i]:
            self.islands.best_time[i] = t
            self.best_partner[i] = j
            self.best_stamp[i] = stamp_j
        if t < self.islands.best_time[j]:
            self.islands.best_time[j] = t
            self.best_partner[j] = i
            self.best_stamp[j] = stamp_i
            self.islands.replay(self.islands.island[j], j)

    @ti.func
    def _sight(self, i, j, speed):
        """How long no other image of j can reach i than the nearest of now; all pairs of a periodic box look again then."""
        return (self.shortest_period / 2.0 - self.radius_of(i) - self.radius_of(j)) / speed

    # Making it so ------------------------------------------------------------------------------------------------------

    @ti.func
    def _check_margin(self, k):
        if self.excursion[k] > self.grid.sorted_reach[k] - self.start_radius[k]:
            self.flight.remember(self.index(k), self.excursion[k])
            ti.atomic_add(self.violations[0], 1)

    @ti.func
    def _keep(self, chunk, k, h):
        i = self.index(k)
        self.state.position[i] = self.local_position[k]
        self.state.velocity[i] = self.local_velocity[k]
        self.tally.keep(chunk, k)
        if ti.static(self.keeps_last_contact):
            self.last_contact[i] = self.local_last_contact[k] - h

    @ti.kernel
    def _commit(self, h: float):
        for q in range(CHUNKS * SMALLEST_BLOCK):
            if q % SMALLEST_BLOCK == 0:
                chunk = q // SMALLEST_BLOCK
                for k in range(self.tally.begin_of(chunk), self.tally.begin_of(chunk + 1)):
                    if self.islands.island[k] >= 0:
                        self._keep(chunk, k, h)
                    else:
                        i = self.index(k)
                        self.state.position[i] = self.start_position[k] + self.start_velocity[k] * h
                        if ti.static(self.keeps_last_contact):
                            self.last_contact[i] = self.last_contact[i] - h
