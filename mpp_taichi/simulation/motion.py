"""Motion: the particles of a phase and their clock, stepped, watched for numbers that are not finite, and taken back."""

import time as clock
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.contacts._base import ContactReport, ContactSolver
from mpp_taichi.device import backends
from mpp_taichi.device.backends import Device
from mpp_taichi.errors import MppError
from mpp_taichi.integrators._trouble import Trouble
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
        self.kernel_calls = 0  # of the launcher; under the serial plan each is one launch
        self.solver_report = SolverReport()
        self.contact_report = ContactReport()
        self.energy_balance: EnergyBalance | None = None

    def _adopt(self, phase: Phase, compiled: CompiledPhase) -> None:
        """Go on with the step of this phase."""
        self.spec, self._particles = phase.spec, phase.particles
        self.integrator, self.dt = compiled.integrator, float(phase.spec.integrator.parameters["dt"])
        self.total_force, self.plan, self.step_work = compiled.total_force, compiled.plan, compiled.work
        self.state, self.launcher, self.energy_meter = compiled.state, compiled.launcher, compiled.energy_meter
        self.contacts, self.launch_limit = compiled.contacts, compiled.launch_limit
        self._compiled_phase = compiled
        self._launch_steps = 1

    def _write(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """Set positions and velocities of all particles, as the method can hold them."""
        self.state.write(position, velocity)
        self.integrator.adopt(self.state, self.dt)  # as others are to see it from now on
        self._start_afresh()

    def _start_afresh(self) -> None:
        """After positions and velocities were set: neither forces kept nor a method's history hold any more."""
        self._prepared = False
        self.launcher.collect()  # the counts so far do not belong to the steps that come

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
        report = self.launcher.collect()
        trouble = self.launcher.trouble()  # waits for the device
        seconds = clock.perf_counter() - began
        if trouble is not None and trouble.is_located:
            self._give_up(saved, trouble, report, dt)
        if report is not None:
            self.solver_report.add(report)
        if self.contacts is not None:
            self._count_contacts(self.contacts, saved)
        if trouble is not None:
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
            self.launcher.prepare(self.time, self.dt)
            self._prepared = True
        origin, first = self._origin_time, self._steps_since_origin
        if dt != self.dt or first + steps > MOST_STEPS_COUNTED:
            origin, first = self.time, 0
        if balance is None:
            self.launcher.advance(origin, dt, first, first + steps)
        else:
            self.launcher.advance_metered(origin, dt, first, first + steps, balance.meter)
        self.kernel_calls += 1

    def _count_contacts(self, contacts: ContactSolver, saved: Any) -> None:
        """Add what the contact solver counted; a contact that it gave up on ends the run where the launch began."""
        found = contacts.collect()
        if found.unresolved:
            self._restore(saved)
            raise first_bad_step.unresolved(found.unresolved, contacts, step=self.step_count, time=self.time)
        self.contact_report += found

    def _give_up(self, saved: Any, trouble: Trouble, report: SolverReport | None, dt: float) -> None:
        """Go back to the last step that a method could take, and say which step it could not take."""
        particle = trouble.particle % self.state.particle_count
        if trouble.kind == "stalled":
            raise first_bad_step.stalled(self.snapshot(), particle, step=self.step_count, time=trouble.time)
        self._restore(saved)
        if trouble.steps:
            self._launch(trouble.steps, dt)
            self.launcher.collect()
        self._move_clock(trouble.steps, dt)
        if report is not None:
            self.solver_report.add(report)
        raise first_bad_step.unsolved(self.snapshot(), particle, step=self.step_count + 1, time=self.time + dt)

    def _fail(self, saved: Any, steps: int, dt: float) -> None:
        """Find the step, the particle and the pair that a NaN began with; leave the last good state standing."""
        stored = [saved]

        def advance(count: int) -> bool:
            self._launch(count, dt)
            return self.launcher.first_bad_particle() < 0

        def keep() -> None:
            stored[0] = self._saved()

        def rewind() -> None:
            self._restore(stored[0])

        bad_step = first_bad_step.first_bad_step(steps, advance, keep, rewind)
        self._move_clock(bad_step - 1, dt)
        before = self.snapshot()
        self._launch(1, dt)
        self.launcher.collect()
        trouble = self.launcher.trouble()
        assert trouble is not None
        rewind()
        singular = any(force.softening == 0.0 for force in self.total_force.pair_forces)
        particle, where = trouble.particle % self.state.particle_count, (self.step_count + 1, self.time + dt)
        raise first_bad_step.explained(before, trouble, particle, step=where[0], time=where[1], pairs_singular=singular)

    def _saved(self) -> tuple[tuple, bool]:
        """The state, and whether a step finds in it what it wants to find."""
        return self.state.save(), self._prepared

    def _restore(self, saved: tuple[tuple, bool]) -> None:
        """Go back to it. What a method remembers was saved; the force that others begin with is computed anew."""
        self.state.restore(saved[0])
        self._start_afresh()
        if self.integrator.memory:
            self._prepared = saved[1]
        self.launcher.clear_trouble()

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
        self.launcher.collect()
        return self.launcher.trouble() is None

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
        if self.launcher.moves_between_steps and offset != 0.0:
            saved = self._saved()
            if not self._prepared:
                self.launcher.prepare(self.time, self.dt)
            self.launcher.look_ahead(self.dt, offset / self.dt)
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
