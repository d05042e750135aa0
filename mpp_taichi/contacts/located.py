"""Hard spheres under a method that chooses its steps: contacts are found on its own path, and the step is cut there."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactReport, ContactSetup, ContactSolver
from mpp_taichi.contacts.location.paths import TIME_ROUNDING, StepPaths
from mpp_taichi.contacts.location.rebound import Rebound
from mpp_taichi.contacts.location.search import StepSearch
from mpp_taichi.contacts.shared.bounce import Bounce
from mpp_taichi.contacts.shared.contact_counts import Tally
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation

MOMENT = 64.0 * TIME_ROUNDING  # of the time; contacts that are nearer count as contacts at one time
MOST_AT_ONCE = 1000  # contacts in a row at one time; more are an inelastic collapse, or spheres that are crushed


@component
@ti.data_oriented
class Located(ContactSolver):
    """Each step of an adaptive method is searched for its first contact, on the polynomial of its samples, and cut there.

    The spheres that touch and approach then bounce, in the order of their numbers; the method begins anew from there with
    the same length of step, so that a contact costs a step. The error is the error of the method, whatever the forces and
    the speeds: no sphere tunnels, however long a step is. Contacts do not depend on the times of samples. Serial, for few
    bodies: each step tests all pairs, and each contact tests them twice more. For spheres that bounce, not for spheres that
    lie, roll or slide: where contacts follow each other ever sooner, give them a `contact_time`, or a run ends at
    `event_limit`.
    """

    restitution: float = param(
        1.0, minimum=0.0, maximum=1.0, help="e, relative speed after the contact over the speed before; 1: elastic"
    )
    contact_time: float = param(
        0.0, minimum=0.0, unit="time", help="t_c: a contact within this time after the last contact is elastic; 0: never"
    )
    event_limit: int = param(100_000, minimum=1, help="contacts between two samples; a run with more ends with an error")

    launched_by = "leading_contacts"
    leads = True
    any_frame = True
    in_turn = "an adaptive method leads it, a step at a time"
    memory = ("due", "last_contact", *StepPaths.BOUNDS)

    def work_fields(self, particle_count: int) -> dict[str, tuple[str, int]]:
        """Time of the contact in the present step, or infinity; time of the last contact of each sphere; bounds of its path."""
        bounds = {name: ("scalar", particle_count) for name in StepPaths.BOUNDS}
        return {"due": ("wide", 1), "last_contact": ("wide", particle_count), **bounds}

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Work on the state's positions and velocities, by the steps of `integrator` under `forces`."""
        self.setup, self.state = setup.with_bounces(self.restitution, self.contact_time), state
        self.bounce = Bounce(self.setup)
        self.tally = Tally(setup.particle_count, self.bounce.walls.account_count, state.wide)
        self.paths = StepPaths(state, self.integrator.path_degree)
        self.search = StepSearch(self.bounce, self.paths, self.tally, state)
        self.rebound = Rebound(self.bounce, self.paths, self.tally, state)

    def prepare(self, time: float) -> None:
        """Begin at `time`, in no step, and without any contact before."""
        self.state.due.from_numpy(np.array([np.inf]))
        self.state.last_contact.from_numpy(np.full(self.setup.particle_count, -np.inf))

    def lead(self, time: float, dt: float, first: int, last: int) -> None:
        """Go on through the samples `first` + 1 … `last`, and write the state of the last; a later contact is left."""
        with quick_compilation():
            self._lead(time, dt, first, last)

    @ti.kernel
    def _lead(self, time: ti.f64, dt: ti.f64, first: ti.i32, last: ti.i32):
        ti.loop_config(serialize=True)
        for _ in range(1):
            k, contacts, stuck = first + 1, 0, 0
            while k <= last:
                end = time + k * dt  # with the same bits, however a run is divided into launches
                touches = self.state.due[0] <= end
                if not touches and self.integrator.is_short_of(self.state, 0, end):
                    self._take_step()
                else:
                    if touches or k == last:
                        self.integrator.show(self.state, self.forces, 0, ti.min(self.state.due[0], end))
                    if touches:
                        moves = self.state.due[0] - self.state.clock[0] > MOMENT * ti.abs(self.state.clock[0])
                        stuck = 0 if moves else stuck + 1
                        contacts += self._touch(self.event_limit - contacts)
                    else:
                        k += 1
                        contacts = 0
                    if contacts > self.event_limit or stuck > MOST_AT_ONCE:
                        self.tally.give_up(0, 1)
                        k = last + 1

    @ti.func
    def _take_step(self):
        """Take the next step, and find the time of its first contact."""
        if self.state.clock[1] > 0.0:
            self.integrator.enter_next(self.state, self.forces, 0)
        self.integrator.take_step(self.state, self.forces, 0, "serial")
        self.state.due[0] = ti.cast(ti.math.inf, self.state.wide)
        if self.state.clock[1] > 0.0:
            self.paths.take(self.state, self.forces, self.integrator)
            share = self.search.first_contact()
            if share <= 1.0:
                self.state.due[0] = self.state.clock[0] + share * self.state.clock[1]

    @ti.func
    def _touch(self, limit):
        """Let all contacts that are due bounce, and begin the method anew; returns the number of bounces, 1 at least."""
        time = self.state.due[0]
        bounces = self.rebound.bounce_all(time, limit)
        self.integrator.begin_again(self.state, self.forces, 0, time, "serial")
        self.state.due[0] = ti.cast(ti.math.inf, self.state.wide)
        return ti.max(bounces, 1)

    def sum_fields(self) -> tuple[Any, ...]:
        """Virial, energy and impulses on surfaces."""
        return self.tally.sum_fields

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        return self.tally.collect()

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.bounce, self.tally, self.paths):
            part.destroy()

    def failure(self, count: int) -> str:
        """The message for contacts that followed each other too quickly, or spheres that stayed nearly in contact."""
        return (
            f"more than {self.event_limit:,} contacts between two samples, or ever more at one time, "
            "or spheres that roll, slide or lie on each other; try a contact_time, or a smaller dt"
        )
