"""Compiled phase: the step of a phase on a device, with its fields, forces and method under one plan."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.contacts._base import ContactSolver
from mpp_taichi.device import backends
from mpp_taichi.device.backends import Device
from mpp_taichi.device.fast_taichi.large_pages import MANY_PARTICLES, use_large_pages
from mpp_taichi.errors import BackendError
from mpp_taichi.precision import carries_low_parts, forces_have_low_parts
from mpp_taichi.scene.asked_quantities import tangent_quantities
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation import refusals
from mpp_taichi.simulation.clock import Clock
from mpp_taichi.simulation.constraints import given_functions_of, moved_ahead, rods_of, with_changes
from mpp_taichi.simulation.course import Phase
from mpp_taichi.snapshot import Snapshot, springs_differ
from mpp_taichi.start.contact_setup import contact_setup
from mpp_taichi.start.tangent_copies import copies_of
from mpp_taichi.state.tangent_growth import TangentGrowth
from mpp_taichi.state.vector_layout import layout_of
from mpp_taichi.walls._base import Surface

if TYPE_CHECKING:
    from mpp_taichi.energy.energy_meter import PowerMeter
    from mpp_taichi.step.acceleration import AccelerationMeter


@dataclass(frozen=True, eq=False)
class SavedFields:
    """The state of a phase, bit for bit, with all that its method and its contacts remember."""

    arrays: tuple[np.ndarray, ...]
    prepared: bool
    contacts: tuple[np.ndarray, ...] = ()  # what the contact solver knows beyond the arrays
    sums: tuple[np.ndarray, ...] | None = None  # of the contacts of the phase; empty without contacts, None: not saved


class CompiledPhase:
    """A phase on a device, ready to step; its kernels are compiled when they first run.

    `phase` is the phase whose numbers it has now: phases between which only sliders move share one of these.

    Raises:
        MppError: the phase cannot run on this device, under this plan or in this precision; see `refusals`.
    """

    def __init__(
        self, phase: Phase, device: Device, *, plan: str, replica_starts: tuple[Snapshot, ...], event_log: bool
    ) -> None:
        """Import the components that the phase names, allocate its fields and fill them."""
        # Taichi code is imported here and not before, and only the components that the scene names.
        from mpp_taichi.energy.energy_meter import EnergyMeter
        from mpp_taichi.forces._composition import compose
        from mpp_taichi.forces._fewer_pairs import fewer_pairs
        from mpp_taichi.forces._spring_limits import with_limits
        from mpp_taichi.forces._spring_slices import spring_slices
        from mpp_taichi.forces._total_force import TotalForce
        from mpp_taichi.state.live_parameters import LiveParameters
        from mpp_taichi.state.tangent_meter import TangentMeter
        from mpp_taichi.step.choose import launcher_for, settle_plan

        spec, start = phase.spec, phase.particles
        self.phase, self.work, self.device, self.replica_starts = phase, phase.work, device, replica_starts
        self.integrator = component.build("integrators", spec.integrator.name, spec.integrator.parameters)
        two_parts = forces_have_low_parts(device.precision)
        rods = rods_of(spec, start, device)
        self.has_tangent = bool(tangent_quantities(spec))
        self.copies = copies_of(spec, start)
        self.replica_count = self.copies * max(1, len(replica_starts))
        given = given_functions_of(spec, start, device, plan=plan, replica_count=self.replica_count)
        forces = compose(spec, start)
        self.live = LiveParameters(spec.forces, forces, two_parts=two_parts, replica_count=self.replica_count)
        limited, limits = with_limits(start, self.live.forces)
        self.total_force = TotalForce(
            limited,
            start.particle_count,
            spec.dimensions,
            merges=start.merged_into is not None,
            derivatives=self.integrator.derivatives,
            two_parts=two_parts,
            rods=rods,
            given=given,
            fewer=fewer_pairs(self, forces, asked=plan),
            limits=limits,
        )
        self.total_force.live = self.live if self.replica_count > 1 else None
        refusals.check_numbers(spec, start, self.total_force, device.precision)
        refusals.check_sines(spec, self.total_force.forces, device)
        if self.has_tangent:
            refusals.check_tangent(spec, self.integrator, self.total_force.forces, device.precision, plan, self.copies)
        self.plan = settle_plan(
            plan,
            name=spec.integrator.name,
            integrator=self.integrator,
            total_force=self.total_force,
            device=device,
            work=self.work,
            replica_count=self.replica_count,
        )
        if self.has_tangent:
            self.plan = "replicas" if self.replica_count > 1 else "serial"
            self.integrator.follows_deviation = self.integrator.takes_tangent
        self.total_force.slices = spring_slices(self)
        self.contacts, self.state = self._allocate(event_log)
        self.total_force.fill(self.state)
        self.total_force.place_springs(self.state, start.springs)
        if any(target.kind == "springs" for slider in spec.sliders for target in slider.targets):
            self.state.write_springs(start)  # so that the kernels that write them are compiled before a slider moves
        if self.contacts is not None:
            force_free = not (forces or self.integrator.draws_random)
            self.contacts.bind(contact_setup(spec, start, force_free=force_free), self.state)
        self.tangent = TangentMeter(self.state, start.free, self.copies, on_cpu=device.on_cpu) if self.has_tangent else None
        self.launcher = launcher_for(
            self.state,
            self.total_force,
            self.integrator,
            plan=self.plan,
            on_cpu=device.on_cpu,
            loop_limit=device.probes.loop_limit,
            contacts=self.contacts,
            tangent_meter=self.tangent,
        )
        self.energy_meter = EnergyMeter(self.state, self.total_force)
        self.launch_limit = refusals.steps_per_launch(self.launcher, self.total_force, device, self.plan)
        self.prepared = False  # whether the next step finds in the state the forces or the history that it begins with
        if device.on_cpu and start.particle_count >= MANY_PARTICLES:
            use_large_pages()

    def _allocate(self, event_log: bool) -> tuple[ContactSolver | None, Any]:
        """The contact solver, if the scene has one, and the state with every field that the step works with."""
        from mpp_taichi.state.state import State

        spec, start, device, integrator = self.spec, self.particles, self.device, self.integrator
        fields = integrator.work_fields(self.total_force, start, plan=self.plan, on_cpu=device.on_cpu)
        scratch_count = integrator.scratch_count(self.total_force.depends_on_velocity)
        if carries_low_parts(device.precision):
            refusals.check_low_parts(spec, integrator, self.total_force.forces, device.precision)
            refusals.check_range(start, self.total_force, device.precision)
            scratch_count += integrator.low_scratch_count() * (2 if forces_have_low_parts(device.precision) else 1)
            fields = {**fields, "step_parts": ("vector2", len(integrator.step_numbers(1.0)))}
        fields = {**fields, **self.total_force.work_fields()}
        solver = self._contact_solver(event_log) if spec.contacts is not None else None
        if solver is not None:
            fields = {**fields, **solver.work_fields(start.particle_count)}
        memory = (*integrator.memory, *self.total_force.memory, *(solver.memory if solver is not None else ()))
        if self.has_tangent:
            from mpp_taichi.state.tangent_meter import TangentMeter
            from mpp_taichi.state.tangent_state import tangent_fields

            fields = {**fields, **tangent_fields(start.particle_count, scratch_count), **TangentMeter.work_fields()}
            memory = (*memory, *TangentMeter.memory())
        sizes = {"dimensions": spec.dimensions, "replica_count": self.replica_count}
        refusals.check_room(fields, **sizes, on_cpu=device.on_cpu)
        state = State(
            start,
            **sizes,
            needs=self.total_force.needs | integrator.needs,
            scratch_count=scratch_count,
            slopes=integrator.slopes(self.total_force.depends_on_velocity),
            layout=layout_of(self.total_force.has_pairs, self.replica_count, on_cpu=device.on_cpu),
            wide=backends.widest_float(device),
            work=fields,
            memory=memory,
            precision=device.precision,
            guards_rounding=not device.probes.compensation,
            centered=integrator.steps_about_center and self._acts_inside_alone(solver),
            own_springs=springs_differ(self.replica_starts),
        )
        return solver, state

    def _acts_inside_alone(self, solver: ContactSolver | None) -> bool:
        """Whether the motion is the same in every frame that moves uniformly, and each part of the step works in any frame.

        That is so where particles act on each other only: without external forces, walls and axes that are held.
        """
        spec, start = self.spec, self.particles
        if self.total_force.external or spec.walls or not start.free[:, : spec.dimensions].all():
            return False
        return start.merged_into is None and (solver is None or solver.any_frame)

    def _contact_solver(self, event_log: bool) -> ContactSolver:
        """The contact solver of the scene, not yet bound to its spheres."""
        if self.plan == "replicas":
            raise BackendError("the plan replicas has no contacts; run one copy of the scene")
        assert self.spec.contacts is not None
        name, parameters = self.spec.contacts.solver.name, self.spec.contacts.solver.parameters
        solver: ContactSolver = component.build("contacts", name, parameters)
        refusals.check_contacts(self.spec, solver, self.particles.particle_count, device=self.device, logs=event_log)
        solver.logs, solver.follows_deviation = event_log, self.has_tangent
        solver.forces, solver.integrator = self.total_force, self.integrator
        return solver

    @property
    def spec(self) -> SceneSpec:
        """The scene of the phase."""
        return self.phase.spec

    @property
    def particles(self) -> Snapshot:
        """The particles of the phase, placed as at the start of the run."""
        return self.phase.particles

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The surfaces of the walls, in the order of the numbers in a log of contacts."""
        return () if self.contacts is None else self.contacts.setup.enclosure.surfaces

    # State

    def adopt(self, phase: Phase) -> None:
        """Take the numbers of another phase that has the same kernels."""
        if phase is self.phase:
            return
        self.live.write(phase.spec.forces)
        if phase.particles.springs is not self.phase.particles.springs:
            self.state.write_springs(phase.particles)
            self.total_force.place_slices(self.state, phase.particles.springs)
        self.phase = phase

    def place(self, start: Snapshot, dt: float) -> None:
        """Put all particles where a snapshot has them, or each replica where its own start has them, for steps of `dt`."""
        if self.state.merges and not self.replica_starts:
            self.state.write_spheres(start)
        starts = [each for each in self.replica_starts for _ in range(self.copies)]
        if starts:
            self.state.write_properties(starts)
        self.state.write_snapshots([replace(each, velocity=each.velocity * each.moving) for each in starts or (start,)])
        self.total_force.place_springs(self.state, start.springs)
        if self.tangent is not None:
            self.tangent.begin()
        self._begin_afresh(dt, start.step)

    def take_restitution(self, spec: SceneSpec) -> None:
        """Let spheres bounce as another scene of the same spheres says, where the contact solver can."""
        if self.contacts is not None and self.contacts.takes_restitution:
            assert spec.contacts is not None
            self.contacts.take_restitution(spec.contacts.solver.parameters["restitution"], contact_setup(spec, self.particles))

    def take_over(self, earlier: "CompiledPhase", dt: float, step: int) -> None:
        """Go on at this step from the state of an earlier phase, bit for bit; an axis that is held from now on stops."""
        if earlier is not self:
            self.state.take_over(earlier.state, self.particles.moving)
            if self.total_force.has_limits:
                self.total_force.limits.take_over(self.state, earlier.state)
        self._begin_afresh(dt, step)

    def _begin_afresh(self, dt: float, step: int) -> None:
        """Round positions and velocities as the method has them; forget forces and history; begin the sums of contacts."""
        self.total_force.begin(self.state)
        self._begin_sums()
        self.integrator.adopt(self.state, dt)
        self.integrator.count_from(self.state, step)
        self._forget()

    def _begin_sums(self) -> None:
        if self.contacts is not None:
            self.contacts.begin_sums()

    def _forget(self) -> None:
        self.prepared = False
        self.launcher.collect()  # counts of earlier steps do not belong to later steps

    def save(self, *, whole: bool = True) -> SavedFields:
        """The state now, for `restore`; not `whole`: without what a contact solver knows beyond it, which changes last bits."""
        contacts = self.contacts.save() if whole and self.prepared and self.contacts is not None else ()
        sums = (() if self.contacts is None else self.contacts.save_sums()) if whole else None
        return SavedFields(self.state.save(), self.prepared, contacts, sums)

    def restore(self, saved: SavedFields) -> None:
        """Go back to a state. The history of a method was saved with it; forces that other methods keep are computed anew."""
        self.state.restore(saved.arrays)
        self._forget()
        if self.integrator.memory:
            self.prepared = saved.prepared
        if saved.contacts and self.contacts is not None:
            self.contacts.restore(saved.contacts)
            self.prepared = True
        if saved.sums and self.contacts is not None:
            self.contacts.restore_sums(saved.sums)
        elif saved.sums is not None:
            self._begin_sums()
        self.launcher.clear_trouble()

    # Steps

    def warm_up(self, clock: Clock) -> None:
        """Take a step as after a start, so that all fields are filled that no saved state has, such as tolerances and sums.

        The state is meaningless afterwards, until `restore`; counts and collisions of the step are dropped.
        """
        self.integrator.arrange(self.state)
        self.prepared = False
        self.prepare(clock)
        self.launcher.advance(clock.time, clock.dt, 0, 1)
        self.launcher.collect()
        if self.contacts is not None:
            self.contacts.collect()
            self.contacts.take_log()

    def prepare(self, clock: Clock) -> None:
        """Compute the forces and the history that the next step begins with, unless they are there."""
        if not self.prepared:
            self.launcher.prepare(clock.time, clock.dt)
            self.prepared = True

    def snapshot(self, clock: Clock, replica: int = 0) -> Snapshot:
        """Host copy of all particles now, in float64 whatever the precision is."""
        position, velocity, comoving = self.state.read_with_frame(replica)
        position = position if self.phase.box is None else self.phase.box.inside(position)
        moved = self.particles.moved(position=position, velocity=velocity, time=clock.time, step=clock.step_count)
        found = with_changes(self.spec, moved if comoving is None else replace(moved, comoving=comoving))
        if self.total_force.has_limits:
            found = replace(found, springs=self.total_force.limits.read(self.state, self.particles.springs))
        return replace(found, **self.state.read_spheres(self.particles)) if self.state.merges else found

    def snapshot_ahead(self, clock: Clock, offset: float) -> Snapshot:
        """The particles at a time `offset` < dt after now: at x + v offset, or along the orbits that the method drifts on."""
        if self.launcher.moves_between_steps and offset != 0.0:
            saved = self.save()
            if not self.prepared:
                self.launcher.prepare(clock.time, clock.dt)
            self.launcher.look_ahead(clock.dt, offset / clock.dt)
            self.state.pass_time(1, offset)
            found = self.snapshot(clock)
            self.restore(saved)
            return found.moved(position=found.position, velocity=found.velocity, time=clock.time + offset, step=found.step)
        return moved_ahead(self.spec, self.snapshot(clock), offset)

    # Meters

    @cached_property
    def acceleration_meter(self) -> "AccelerationMeter":
        """Meter of the accelerations by these forces; its kernels are compiled when it first measures."""
        from mpp_taichi.step.acceleration import AccelerationMeter  # needed by few runs

        return AccelerationMeter(self.state, self.total_force, self.launcher.force_sum)

    def power_meter(self) -> "PowerMeter":
        """A new meter of the powers of these forces, for an energy balance."""
        from mpp_taichi.energy.energy_meter import PowerMeter

        # A serial launch on a device that limits its loops has no room for the loops of the meter.
        in_kernel = self.plan == "serial" and self.contacts is None and self.device.probes.loop_limit is None
        return PowerMeter(self.state, self.total_force, (*self.replica_starts, self.particles)[0].mass, in_kernel=in_kernel)

    def read_tangent(self) -> TangentGrowth:
        """The growth of the deviation of every system; TypeError where no quantity of the scene asks for it."""
        if self.tangent is None:
            raise TypeError("no quantity of this scene needs the tangent of its steps")
        return self.tangent.read()

    # Conserved quantities

    @property
    def conserves_energy(self) -> bool:
        """Whether every force has a potential and no contact or bath takes energy, so that the total energy is constant."""
        contacts = self.contacts is None or self.contacts.conserves_energy
        return self.total_force.conserves_energy and contacts and not self.integrator.draws_random

    @property
    def gains_no_energy(self) -> bool:
        """Whether no force, contact or bath adds energy, so that the total energy does not grow."""
        contacts = self.contacts is None or self.contacts.gains_no_energy
        return self.total_force.gains_no_energy and contacts and not self.integrator.draws_random

    @property
    def lost_by_springs(self) -> float:
        """Energy that springs have lost by breaking and yielding since they were placed [energy]."""
        return self.total_force.limits.loss(self.state) if self.total_force.has_limits else 0.0

    @property
    def conserves_momentum(self) -> bool:
        """Whether particles act on each other only, along the line between them, so that the total momentum is constant.

        An external force or a bath changes the momentum, and so do walls, an axis that is held and a mass that changes.
        """
        free = bool(self.particles.free[:, : self.spec.dimensions].all()) and not self.integrator.draws_random
        return free and not (self.total_force.external or self.total_force.has_changes or self.surfaces)

    @property
    def conserves_angular_momentum(self) -> bool:
        """Whether the total angular momentum is constant: not in a periodic box, nor where spheres merge."""
        return self.conserves_momentum and not any(self.phase.enclosure.period) and not self.state.merges

    def destroy(self) -> None:
        """Give the device memory back."""
        self.launcher.destroy()
        self.live.destroy()
        if self.contacts is not None:
            self.contacts.destroy()
        self.total_force.destroy()
        self.state.destroy()
