"""Event-driven hard spheres: exact free flight from contact to contact."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactReport, ContactSetup, ContactSolver
from mpp_taichi.contacts.events.cells import EventCells
from mpp_taichi.contacts.events.collision import Collision
from mpp_taichi.contacts.events.deviation import Deviation
from mpp_taichi.contacts.events.grid import Grid
from mpp_taichi.contacts.events.lines import Lines
from mpp_taichi.contacts.events.log import ContactLog
from mpp_taichi.contacts.events.lookahead import LookAhead
from mpp_taichi.contacts.events.prediction import Prediction
from mpp_taichi.contacts.events.queue import EventQueue
from mpp_taichi.contacts.events.spheres import FlyingSpheres
from mpp_taichi.device import bulk_copy
from mpp_taichi.device.bulk_copy import MixedFields
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation
from mpp_taichi.errors import StabilityError
from mpp_taichi.walls._surfaces import WallSurfaces
from mpp_taichi.wording.told_apart import told_apart

# Events of one launch, which take a fraction of a second, so that Python can be interrupted.
EVENTS_PER_LAUNCH = 200_000
RUNNING, ARRIVED, FULL, COLLAPSED = range(4)


@component
@ti.data_oriented
class EventDriven(ContactSolver):
    """Spheres fly freely, fall under uniform gravity, and bounce at the exact time of contact, one event after another.

    Exact to round-off, whatever the density and speed; contacts of more than two spheres at once are resolved pair by pair, in
    an order that depends on the start. Serial. If infinitely many contacts fall into a finite time (inelastic collapse), the
    run stops with an error, unless `contact_time` ends the cascade.
    Sources: Lubachevsky, J. Comput. Phys. 94 (1991) 255; Bannerman et al., Comput. Particle Mech. 1 (2014) 191; Luding and
    McNamara, Granular Matter 1 (1998) 113.
    """

    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="share of the approach speed that a bounce gives back")
    contact_time: float = param(
        0.0,
        minimum=0.0,
        unit="time",
        help="a contact within this time after the last contact of either sphere is elastic; 0: never",
    )
    event_limit: int = param(
        10_000_000, minimum=1, help="contacts of a thousand spheres between two samples; a run with more ends with an error"
    )

    launched_by = "flying_contacts"
    flies = True
    order = 0
    in_turn = "it takes one event after the other from a queue"
    can_log = True
    takes_tangent = True
    takes_heat = True
    takes_restitution = True
    log_capacity = 65_536  # contacts that are logged on the device before the host takes them

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Work on the `position` and `velocity` fields of a state. Raises ValueError for a periodic box that is too small."""
        self.setup, self.state = setup.with_bounces(self.restitution, self.contact_time), state
        self.count, self.dimensions = setup.particle_count, setup.dimensions
        self.wide = getattr(state, "wide", ti.f64)
        position = state.position.to_numpy().astype(float)
        grid = Grid.around(setup, position)
        cell, _ = grid.cell_of(position)
        order = grid.order_of(cell)
        self._order = order
        self.walls = WallSurfaces(setup.enclosure)  # filled before any field is left to be placed
        builder = ti.FieldsBuilder()
        lines = Lines(self.count)
        self.spheres = FlyingSpheres(setup, order, lines, self.wide)
        self.cells = EventCells(grid, self.spheres, lines, builder)
        self.queue = EventQueue(self.spheres, lines, builder)
        self.look_ahead = LookAhead(self.spheres, self.cells, self.queue, builder)
        self.prediction = Prediction(self.look_ahead, self.walls, lines)
        self.deviation = Deviation(state, self.spheres, self.walls, lines, builder) if self.follows_deviation else None
        self.collision = Collision(self.setup, self.spheres, self.cells, self.walls, builder, deviation=self.deviation)
        self.log = ContactLog(self.log_capacity if self.logs else 0, builder, self.wide)
        self.event_time = ti.field(self.wide)
        self.culprits = ti.field(ti.i32)
        builder.place(self.event_time)
        builder.dense(ti.i, 2).place(self.culprits)
        self._trees = lines.place(), builder.finalize()
        self.collision.write(self.setup)
        self.look_ahead.write()
        # Where the queue has an event follows from the times of all events, so that the queue is sorted anew.
        parts = (self.spheres, self.cells, self.queue, self.prediction, *([self.deviation] if self.deviation else []))
        self._lasting = tuple(field for part in parts for field in part.lasting)
        self._saved = MixedFields(self._lasting)

    def take_restitution(self, restitution: float, setup: ContactSetup) -> None:
        """Write the table of restitutions, which is no part of the kernels."""
        self.restitution = restitution
        self.setup = setup.with_bounces(restitution, self.contact_time)
        self.collision.write(self.setup)

    def prepare(self, time: float) -> None:
        """Begin at `time` from the state."""
        position = self.state.position.to_numpy().astype(float)
        velocity = self.state.velocity.to_numpy().astype(float)
        cell, turns = self.cells.grid.cell_of(position)
        inside = position - turns * np.array(self.cells.grid.period)
        self.spheres.write(inside, velocity, time)
        self.cells.write(cell[self._order], turns[self._order])
        self.queue.clear(time, self.count)
        self.event_time[None] = time
        if self.deviation is not None:
            self.deviation.read()

    def save(self) -> tuple[np.ndarray, ...]:
        """Each sphere at its own time, its cell, and its next event."""
        return tuple(self._saved.read())

    def restore(self, saved: Sequence[np.ndarray]) -> None:
        """Go on with the spheres and events of `save`."""
        self.prepare(0.0)  # each sphere and event has a time of its own, which is written next
        bulk_copy.write(self._lasting, saved)

    def advance(self, begin: float, end: float) -> None:
        """Resolve all events up to the time `end`, and write the state at this time.

        Raises StabilityError at an inelastic collapse, and at endless collisions of spheres that are crushed. The motion does
        not depend on the times at which the state is written.
        """
        status, most = RUNNING, self.event_limit * max(1.0, self.count / 1000)
        before = self.collision.contacts()
        while status != ARRIVED:
            contacts = self.collision.contacts() - before
            if contacts > most:
                first, now, last = told_apart(begin, self.event_time[None], end, digits=9)
                raise StabilityError(
                    f"{contacts:,} contacts from time {first} to {now}, short of {last}: "
                    "spheres are crushed, or the time between samples is long (integrator: {event_driven: {dt: …}})"
                )
            with quick_compilation():  # a sixth of the time, for a kernel that is 5 % slower
                status = self._run(end, EVENTS_PER_LAUNCH)
            if status == FULL:
                self.log.empty()
            if status == COLLAPSED:
                a, b = (self.setup.label(self.culprits[k]) for k in range(2))
                raise StabilityError(
                    f"inelastic collapse at time {self.event_time[None]:.9g}: {a} and {b} meet again and again while the time "
                    "no longer moves; give contacts a contact_time"
                )
        self._show(end)

    def sum_fields(self) -> tuple[Any, ...]:
        """Virial, energy and impulses on surfaces."""
        return self.collision.sum_fields

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        return self.collision.collect()

    def take_log(self) -> np.ndarray:
        """Every contact since the last call: records of time, i, j (−1 − w: surface w) and impulse."""
        return self.log.take()

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.walls, *self._trees):
            part.destroy()

    @ti.kernel
    def _run(self, end: ti.f64, limit: ti.i32) -> ti.i32:
        status = RUNNING
        ti.loop_config(serialize=True)
        for _ in range(1):
            left = limit
            while left > 0 and status == RUNNING:
                left -= 1
                i = self.queue.earliest()
                self.look_ahead.look()
                if i < 0:
                    status = ARRIVED
                elif self.queue.time[i] > end:
                    status = ARRIVED
                elif self.log.is_full():
                    status = FULL
                elif not self._next(i):
                    status = COLLAPSED
        return status

    @ti.func
    def _next(self, i):
        """Resolve the event of sphere i, and predict the spheres that it changes; returns whether time still goes on."""
        time, partner = self.queue.time[i], self.queue.partner[i]
        goes_on = True
        other, side = -1, -2
        # At the start, and where the event is stale, only a new prediction is due.
        if partner > self.count:
            side = partner - self.count - 1
            self.cells.cross(i, side)
        elif partner < 0:
            goes_on = self.collision.wall(i, -1 - partner, time)
            self._note(time, i, partner)
        elif partner < self.count:
            if self.queue.stamp[i] == self.spheres.contacts[partner]:
                goes_on = self.collision.pair(i, partner, time)
                self._note(time, i, partner)
                other = partner
        if not goes_on:
            self.collision.unresolved[None] += 1
            self.culprits[0] = self.spheres.order[i]
            self.culprits[1] = self.spheres.order[partner] if partner >= 0 else partner
        self.event_time[None] = time
        k = i
        while k >= 0:
            self.prediction.predict(k, time, side)
            k = other
            other = -1
        if ti.static(self.follows_deviation):
            self.deviation.keep_in_range()
        return goes_on

    @ti.func
    def _note(self, time, i, partner):
        if self.collision.impulse[None] != 0:
            j = self.spheres.order[partner] if partner >= 0 else partner
            self.log.note(time, self.spheres.order[i], j, self.collision.impulse[None])

    @ti.kernel
    def _show(self, time: ti.f64):
        for i in range(self.count):
            self.state.position[self.spheres.order[i]] = self.cells.shown_position(i, ti.cast(time, self.wide))
            self.state.velocity[self.spheres.order[i]] = self.spheres.velocity_at(i, ti.cast(time, self.wide))
