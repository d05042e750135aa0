"""Motion: the particles of a phase and their clock, stepped, watched for numbers that are not finite, and taken back."""

import time as clock
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.contacts._base import ContactReport, ContactSolver
from mpp_taichi.device import backends
from mpp_taichi.device.backends import Device
from mpp_taichi.errors import MppError
from mpp_taichi.simulation import first_bad_step
from mpp_taichi.simulation.first_bad_step import Mark
from mpp_taichi.simulation.phases import CompiledPhase, Phase
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.solvers.report import SolverReport

if TYPE_CHECKING:
    from mpp_taichi.energy.energy_balance import EnergyBalance

LAUNCH_SECONDS = 0.1  # aim for one launch: short enough to interrupt, long enough not to matter
MOST_STEPS_COUNTED = 2**31 - 1  # by kernels, since the last change of the step


class Motion:
    """What moves: the state of a compiled phase, at a time, after so many steps.

    `_adopt` gives it a phase, `_set_clock` a time; then `_advance` steps, and `mark`, `try_steps` and `return_to` let others
    look for the step at which something went wrong.
    """

    def __init__(self, device: Device) -> None:
        """Nothing stands yet but the device."""
        self.device = device
        backends.retain(device)
        self._closed = False
        self.compile_seconds = 0.0
        self.advance_seconds = 0.0
        self.kernel_calls = 0  # of the stepper; under the serial plan each is one launch
        self.solver_report = SolverReport()
        self.contact_report = ContactReport()
        self.energy_balance: EnergyBalance | None = None

    def _adopt(self, phase: Phase, compiled: CompiledPhase) -> None:
        """Go on with the step of this phase."""
        self.spec, self._particles = phase.spec, phase.particles
        self.integrator, self.dt = compiled.integrator, float(phase.spec.integrator.parameters["dt"])
        self.total_force, self.plan, self.step_work = compiled.total_force, compiled.plan, compiled.work
        self.state, self.stepper, self.energy_meter = compiled.state, compiled.stepper, compiled.energy_meter
        self.contacts, self.launch_limit = compiled.contacts, compiled.launch_limit
        self._compiled_phase = compiled
        self._launch_steps = 1

    def _write(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """Set positions and velocities of all particles, as the method can hold them."""
        self.state.write(position, velocity)
        self.integrator.adopt(self.state)  # as others are to see it from now on
        self._start_afresh()

    def _start_afresh(self) -> None:
        """After positions and velocities were set: neither forces kept nor a method's history hold any more."""
        self._prepared = False
        if self.integrator.implicit:
            self.stepper.solver_report()  # what was counted before does not belong to what comes

    # --- time -----------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time: step count × dt, so that it does not gather rounding errors."""
        return self._origin_time + self._steps_since_origin * self.dt

    @property
    def step_count(self) -> int:
        """Steps taken since the start."""
        return self._origin_step + self._steps_since_origin

    def _set_clock(self, time: float, step: int) -> None:
        self._origin_time, self._origin_step, self._steps_since_origin = time, step, 0

    def _move_clock(self, steps: int, dt: float) -> None:
        if dt == self.dt:
            self._steps_since_origin += steps
        else:
            self._set_clock(self.time + steps * dt, self.step_count + steps)

    # --- steps ----------------------------------------------------------------------------------------------------------

    def _advance(self, steps: int, dt: float) -> None:
        """One launch, timed, and looked over for numbers that are not finite."""
        self._require_life()  # a recorder may have closed the simulation, or started Taichi for itself
        saved, prepared = self._saved(), self._prepared
        began = clock.perf_counter()
        self._launch(steps, dt, self.energy_balance)
        particle = self.stepper.first_bad_particle()  # waits for the device
        seconds = clock.perf_counter() - began
        if self.integrator.implicit:
            report = self.stepper.solver_report()
            if report.unsolved:
                self._give_up(saved, report, dt)
            self.solver_report.add(report)
        if self.integrator.adaptive and (stalled := self.stepper.stalled_particle()) >= 0:
            raise first_bad_step.stalled(
                self.snapshot(), stalled % self.state.particle_count, step=self.step_count, time=self.stepper.adaptive_time()
            )
        if self.contacts is not None:
            self._count_contacts(self.contacts, saved)
        if particle >= 0:
            self._fail(saved, steps, dt)
        if prepared:
            self.advance_seconds += seconds
            if steps == self._launch_steps:
                self._launch_steps = max(1, min(self._launch_steps * 8, int(steps * LAUNCH_SECONDS / max(seconds, 1e-6))))
        else:
            self.compile_seconds += seconds
        self._move_clock(steps, dt)
        if self.energy_balance is not None:
            self.energy_balance.follow(self, steps, dt)

    def _longest_launch(self) -> int:
        """Most steps the next launch should hold."""
        balance = self.energy_balance
        most = self.launch_limit if balance is None else min(self.launch_limit, balance.meter.longest_launch)
        return min(self._launch_steps, most)

    def _launch(self, steps: int, dt: float, balance: "EnergyBalance | None" = None) -> None:
        if not self._prepared:
            self.stepper.prepare(self.time)
            self._prepared = True
        origin, first = self._origin_time, self._steps_since_origin
        if dt != self.dt or first + steps > MOST_STEPS_COUNTED:
            origin, first = self.time, 0
        self.stepper.advance(origin, dt, steps, None if balance is None else balance.meter, first=first)
        self.kernel_calls += 1

    def _count_contacts(self, contacts: ContactSolver, saved: Any) -> None:
        """Add what the contact solver counted; a contact that it gave up on ends the run where the launch began."""
        found = contacts.collect()
        if found.unresolved:
            self._restore(saved)
            raise first_bad_step.unresolved(found.unresolved, contacts, step=self.step_count, time=self.time)
        self.contact_report += found

    def _give_up(self, saved: Any, report: SolverReport, dt: float) -> None:
        """Go back to the last step whose equations were solved, and say which were not."""
        particle = self.stepper.least_solved_particle() % self.state.particle_count
        self._restore(saved)
        if report.fewest_steps:
            self._launch(report.fewest_steps, dt)
            self.stepper.solver_report()
        self._move_clock(report.fewest_steps, dt)
        self.solver_report.add(report)
        raise first_bad_step.unsolved(self.snapshot(), particle, step=self.step_count + 1, time=self.time + dt)

    def _fail(self, saved: Any, steps: int, dt: float) -> None:
        """Find the step, the particle and the pair that a NaN began with; leave the last good state standing."""
        stored = [saved]

        def advance(count: int) -> bool:
            self._launch(count, dt)
            return self.stepper.first_bad_particle() < 0

        def keep() -> None:
            stored[0] = self._saved()

        def rewind() -> None:
            self._restore(stored[0])

        bad_step = first_bad_step.first_bad_step(steps, advance, keep, rewind)
        self._move_clock(bad_step - 1, dt)
        before = self.snapshot()
        self._launch(1, dt)
        found, lost = self.stepper.first_bad_particle(), self.stepper.lost_particle()
        particle, reason = found % self.state.particle_count, self.integrator.left_lattice(self.state, found)
        rewind()
        if reason:
            raise first_bad_step.left_lattice(before, particle, reason, step=self.step_count + 1, time=self.time + dt)
        if lost >= 0:
            lost %= self.state.particle_count
            raise first_bad_step.unsolved_orbit(before, lost, step=self.step_count + 1, time=self.time + dt)
        singular = any(force.softening == 0.0 for force in self.total_force.pair_forces)
        raise first_bad_step.diagnose(before, particle, step=self.step_count + 1, time=self.time + dt, pairs_singular=singular)

    def _saved(self) -> tuple[tuple, bool]:
        """The state, and whether a step finds in it what it wants to find."""
        return self.state.save(), self._prepared

    def _restore(self, saved: tuple[tuple, bool]) -> None:
        """Go back to it. What a method remembers was saved; the force that others begin with is computed anew."""
        self.state.restore(saved[0])
        self._start_afresh()
        if self.integrator.memory:
            self._prepared = saved[1]
        if self.integrator.implicit:
            unsolved: Any = getattr(self.state, "unsolved")  # noqa: B009 — a work field, there by its name
            unsolved.fill(0)
            self._prepared = saved[1]

    # --- back and forth -------------------------------------------------------------------------------------------------

    def mark(self) -> Mark:
        """The state and its time, to `return_to`; good within the phase."""
        self._require_life()
        return Mark(self._saved(), self._origin_time, self._origin_step, self._steps_since_origin)

    def return_to(self, mark: Mark) -> None:
        """Go back, bit for bit, what a method of several steps remembers as well."""
        self._require_life()
        self._origin_time, self._origin_step, self._steps_since_origin = mark.origin_time, mark.origin_step, mark.steps
        self._restore(mark.saved)

    def try_steps(self, steps: int, dt: float | None = None) -> bool:
        """Advance without recorders and accounts; False, and no error, where a number is not finite or a step not solved.

        `dt` is the length of these steps, where it is not that of the run.
        """
        self._require_life()
        dt = self.dt if dt is None else dt
        while steps > 0:
            count = min(steps, self.launch_limit)
            self._launch(count, dt)
            self._move_clock(count, dt)
            steps -= count
        solved = not (self.integrator.implicit and self.stepper.solver_report().unsolved)
        return solved and self.stepper.first_bad_particle() < 0

    # --- looking --------------------------------------------------------------------------------------------------------

    def snapshot(self, replica: int = 0) -> Snapshot:
        """Host copy of all particles now, float64 whatever the precision."""
        self._require_life()
        position, velocity = self.state.read(replica)
        found = self._particles.moved(position=position, velocity=velocity, time=self.time, step=self.step_count)
        return replace(found, **self.state.read_spheres(self._particles)) if self.state.merges else found

    def snapshot_ahead(self, offset: float) -> Snapshot:
        """The particles an `offset` < dt later, by the motion that the step goes on with: x + v offset, or along orbits."""
        self._require_life()
        if self.integrator.own_state and offset != 0.0:
            saved = self._saved()
            if not self._prepared:
                self.stepper.prepare(self.time)
            self.stepper.look_ahead(self.dt, offset / self.dt)
            found = self.snapshot()
            self._restore(saved)
            return found.moved(position=found.position, velocity=found.velocity, time=self.time + offset, step=found.step)
        now = self.snapshot()
        place = now.position + now.velocity * offset
        return now.moved(position=place, velocity=now.velocity, time=self.time + offset, step=now.step)

    def accelerations(self, snapshot: Snapshot | None = None) -> np.ndarray:
        """Accelerations [length / time²] by the forces now, or where a snapshot of this phase is, (particle_count, 3).

        Friction is included, and 0 stands along an axis that is held; contacts and walls, which act in an instant, are not.
        """
        self._require_life()
        return self._compiled_phase.acceleration_meter.measure(self.snapshot() if snapshot is None else snapshot)

    def mechanics(self) -> dict[str, Any]:
        """Energies, momentum, angular momentum and centre of mass now; see `energy.mechanics`."""
        self._require_life()
        return self.energy_meter.mechanics(self.snapshot(), self.time)

    @property
    def conserves_energy(self) -> bool:
        """Whether every force has a potential, so that energy may be asked to stay."""
        return self.total_force.conserves_energy and (self.contacts is None or self.contacts.conserves_energy)

    @property
    def conserves_momentum(self) -> bool:
        """Whether particles act on each other alone, along the line between them: momentum is to stay.

        An external force changes it, and so does what holds a particle on an axis.
        """
        walls = self.contacts is not None and len(self.contacts.setup.enclosure.surfaces) > 0
        held = not self._particles.free[:, : self.spec.dimensions].all()
        return not self.total_force.external and not held and not walls

    @property
    def conserves_angular_momentum(self) -> bool:
        """Whether that is to stay as well: faces of a periodic box act along another line, and what merges keeps no spin."""
        periodic = self.contacts is not None and any(self.contacts.setup.enclosure.period)
        return self.conserves_momentum and not periodic and not self.state.merges

    @property
    def gains_no_energy(self) -> bool:
        """Whether energy may be asked not to grow."""
        return self.total_force.gains_no_energy and (self.contacts is None or self.contacts.gains_no_energy)

    @property
    def is_alive(self) -> bool:
        """Whether the particles are still there to be read and moved."""
        return not self._closed and backends.is_alive(self.device)

    def _require_life(self) -> None:
        if not self.is_alive:
            raise MppError(
                "this simulation has ended: it was closed, another one started a different backend or precision, or the program"
                " called ti.init or ti.reset"
            )
