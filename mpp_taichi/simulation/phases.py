"""Phases: the scenes that a run goes through, and each of them compiled to one step. Without a timeline there is one."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from mpp_taichi import component
from mpp_taichi.contacts._base import ContactSolver
from mpp_taichi.device import backends
from mpp_taichi.device.backends import Device
from mpp_taichi.device.fast_taichi.large_pages import MANY_PARTICLES, use_large_pages
from mpp_taichi.errors import BackendError, CapacityError, PrecisionError, SceneError, UnsupportedError
from mpp_taichi.precision import carries_low_parts, forces_see_low_parts
from mpp_taichi.scene import sliders
from mpp_taichi.scene.estimate import LARGEST_COUNT, available_bytes
from mpp_taichi.scene.spec import Event, SceneSpec, SliderSpec
from mpp_taichi.scene.timeline import MOVES_ALLOWED
from mpp_taichi.scene.tree_checks import tree_of
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble, springs_of
from mpp_taichi.start.contact_setup import contact_setup
from mpp_taichi.step import plans

if TYPE_CHECKING:
    from mpp_taichi.step.acceleration import AccelerationMeter


@dataclass(frozen=True, eq=False)
class Phase:
    """A scene that holds from a time on.

    particles   placed as at the start, with the masses, charges, colours, held axes and springs of this phase
    changes     what the timeline sets at its beginning, path → value; empty for the first phase
    kernels     what stands for its kernels: the same as in the phase before where sliders alone have moved
    """

    at: float
    spec: SceneSpec
    particles: Snapshot
    changes: dict[str, Any]
    kernels: object = field(default_factory=object)

    @property
    def effects(self) -> list[str]:
        """The effects that its step is compiled from, as scenes call them."""
        return self.spec.effects(len(self.particles.springs))


def phases_of(spec: SceneSpec) -> tuple[Phase, ...]:
    """Every phase of a scene, with its particles made and checked before the first begins."""
    phases = [Phase(-math.inf, spec, assemble(spec), {})]
    for event in spec.timeline:
        start = phases[0].particles
        if event.live:
            phases.append(moved_on(phases[-1], event))
            continue
        made = assemble(event.scene, placed_as=spec)
        particles = replace(made, position=start.position, velocity=start.velocity * made.free)
        phases.append(Phase(event.at, event.scene, particles, event.changes))
    return tuple(phases)


def moved_on(before: Phase, event: Event) -> Phase:
    """The phase that begins where sliders move: the same particles and kernels, with other numbers in them."""
    particles = before.particles
    if any(new is not old for new, old in zip(event.scene.springs, before.spec.springs, strict=True)):
        particles = replace(particles, springs=springs_of(event.scene))
    return Phase(event.at, event.scene, particles, event.changes, before.kernels)


def phase_at(phases: Sequence[Phase], time: float) -> int:
    """Number of the phase that a time is in; at the very time of an event that is the new one."""
    return sum(phase.at <= time for phase in phases) - 1


@dataclass(frozen=True, eq=False)
class Course:
    """What a run goes through: phases[k + 1] begins with timeline[k] of the scene; it begins in phase `first`, at `start`."""

    scene: SceneSpec
    phases: tuple[Phase, ...]
    first: int
    start: Snapshot

    def moved(self, number: int, at: float, moved: Mapping[SliderSpec, float]) -> tuple["Course", int]:
        """The course on which sliders move at a time in the phase `number`, and the number of the phase that begins with it.

        What moves at a time at which something has changed already joins that. Later events keep what they set themselves.

        Raises:
            SceneError: there were too many changes.
        """
        present, timeline = self.phases[number], self.scene.timeline
        changes = {slider.path: value for slider, value in moved.items()}
        joins = number > 0 and present.at == at
        changes = {**present.changes, **changes} if joins else changes
        live = timeline[number - 1].live if joins else True
        place = next(iter(moved)).location
        events = [Event(at, changes, sliders.with_values(present.spec, moved), place, live)]
        phases = [moved_on(present, events[0])]
        left = dict(moved)
        for event, phase in zip(timeline[number:], self.phases[number + 1 :], strict=True):
            before = self.phases[number + len(events) - 1].spec
            left = {slider: value for slider, value in left.items() if not sliders.is_set(slider, event, before)}
            known = {slider.steps: slider for slider in event.scene.sliders}
            still = {known[slider.steps]: value for slider, value in left.items() if slider.steps in known}
            events.append(replace(event, scene=sliders.with_values(event.scene, still)) if still else event)
            made = moved_on(phase, events[-1]) if still else phase
            # Where sliders alone have moved, the kernels are those of the phase before, whichever that now is.
            phases.append(replace(made, kernels=phases[-1].kernels) if event.live else made)
        first = number if joins else number + 1
        if first - 1 + len(events) > MOVES_ALLOWED:
            raise SceneError(f"{self.scene.source}: timeline: {MOVES_ALLOWED:,} moves of sliders are all that are kept")
        written = list(self.scene.resolved.get("timeline", ()))
        written[first - 1 :] = [{"at": event.at, "set": event.changes} for event in events]
        scene = replace(
            self.scene,
            timeline=(*timeline[: first - 1], *events),
            resolved={**self.scene.resolved, "timeline": written},
        )
        course = Course(scene, (*self.phases[:first], *phases), self.first, self.start)
        return (replace(course, first=first) if at == self.start.time else course), first


class CompiledPhase:
    """The step of a phase on a device: fields, forces and integrator under one plan; kernels are compiled when first run.

    BackendError when the plan asked for does not fit, CapacityError when the device cannot run one step.
    """

    def __init__(
        self, phase: Phase, device: Device, *, plan: str, replica_starts: tuple[Snapshot, ...], event_log: bool
    ) -> None:
        """Import what the phase names, allocate and fill its fields."""
        # Only now may Taichi code be imported, and only what the scene names.
        from mpp_taichi.energy.energy_meter import EnergyMeter
        from mpp_taichi.forces._total_force import TotalForce, compose
        from mpp_taichi.state.live_parameters import LiveParameters
        from mpp_taichi.state.state import State
        from mpp_taichi.step.choose import launcher_for, settle_plan

        spec, start, self.phase = phase.spec, phase.particles, phase
        self.work = plans.step_work(spec, start.particle_count, len(start.springs))
        self.integrator = component.build("integrators", spec.integrator.name, spec.integrator.parameters)
        merges = start.merged_into is not None
        self.live = LiveParameters(spec.forces, compose(spec, start))
        self.total_force = TotalForce(
            self.live.forces,
            start.particle_count,
            spec.dimensions,
            merges=merges,
            derivatives=self.integrator.derivatives,
        )
        check_sines(spec, self.total_force.forces, device)
        replica_count = max(1, len(replica_starts))
        self.plan = settle_plan(
            plan,
            name=spec.integrator.name,
            integrator=self.integrator,
            total_force=self.total_force,
            device=device,
            work=self.work,
            replica_count=replica_count,
        )
        work_fields = self.integrator.work_fields(self.total_force, start, plan=self.plan, on_cpu=device.on_cpu)
        scratch_count = self.integrator.scratch_count(self.total_force.depends_on_velocity)
        if carries_low_parts(device.precision):
            check_low_parts(spec, self.integrator, device)
            scratch_count += self.integrator.low_scratch_count()
            work_fields = {**work_fields, "step_parts": ("pair", len(self.integrator.step_numbers(1.0)))}
        solver = None
        if spec.contacts is not None:
            solver = self._contact_solver(spec, device, start.particle_count, event_log=event_log)
        if solver is not None:
            work_fields = {**work_fields, **solver.work_fields(start.particle_count)}
        check_room(work_fields, dimensions=spec.dimensions, replica_count=replica_count, on_cpu=device.on_cpu)
        self.state = State(
            start,
            dimensions=spec.dimensions,
            needs=self.total_force.needs,
            scratch_count=scratch_count,
            streaming=self.total_force.has_pairs,
            replica_count=replica_count,
            wide=backends.widest_float(device),
            work=work_fields,
            memory=(*self.integrator.memory, *(solver.memory if solver is not None else ())),
            precision=device.precision,
            guards_rounding=not device.probes.compensation,
        )
        if any(target.kind == "springs" for slider in spec.sliders for target in slider.targets):
            self.state.write_springs(start)  # so that what copies them is compiled before they move
        if solver is not None:
            solver.bind(contact_setup(spec, start, force_free=not self.total_force.forces), self.state)
        self.contacts = solver
        self.launcher = launcher_for(
            self.state, self.total_force, self.integrator, plan=self.plan, on_cpu=device.on_cpu, contacts=self.contacts
        )
        self.energy_meter = EnergyMeter(self.state, self.total_force)
        self.launch_limit = self._steps_per_launch(device)
        if device.on_cpu and start.particle_count >= MANY_PARTICLES:
            use_large_pages()

    @cached_property
    def acceleration_meter(self) -> "AccelerationMeter":
        """Of these forces; its kernels are compiled at its first look."""
        from mpp_taichi.step.acceleration import AccelerationMeter  # only for those who ask

        return AccelerationMeter(self.state, self.total_force, self.launcher.force_sum)

    def adopt(self, phase: Phase) -> None:
        """Take on the numbers of a phase that these kernels serve."""
        if phase is self.phase:
            return
        self.live.write(phase.spec.forces)
        if phase.particles.springs is not self.phase.particles.springs:
            self.state.write_springs(phase.particles)
        self.phase = phase

    def destroy(self) -> None:
        """Give the device memory back."""
        self.live.destroy()
        if self.contacts is not None:
            self.contacts.destroy()
        self.total_force.destroy()
        self.state.destroy()

    def _contact_solver(self, spec: SceneSpec, device: Device, count: int, *, event_log: bool) -> ContactSolver:
        """The scene's contact solver, not yet bound to its spheres."""
        if self.plan == "replicas":
            raise BackendError("the plan replicas has no contacts; run one copy of the scene")
        assert spec.contacts is not None
        solver: ContactSolver = component.build("contacts", spec.contacts.solver.name, spec.contacts.solver.parameters)
        if not device.on_cpu:
            check_contacts(spec.contacts.solver.name, solver, count, device)
        if event_log and not solver.can_log:
            name = spec.contacts.solver.name
            raise SceneError(f"{spec.contacts.solver.location}: {name} keeps no log of events, allowed: event_driven, merging")
        solver.logs = event_log
        solver.forces, solver.integrator = self.total_force, self.integrator
        return solver

    def _steps_per_launch(self, device: Device) -> int:
        """Most steps one launch may hold: software Vulkan stops a thread's loops in silence."""
        limit = device.probes.loop_limit
        if limit is None:
            return 2**31 - 1
        if self.plan == "parallel":
            longest = self.total_force.longest_loop
            allowed = 2**31 - 1
        else:
            longest = self.launcher.loop_iterations_per_step()
            allowed = limit // longest
        if longest > limit:
            raise CapacityError(
                f"this device ({device.name}) stops a kernel thread after {limit:,} loop iterations, and one step of "
                f"{self.state.particle_count:,} particles under the {self.plan} plan needs {longest:,}; "
                "use --backend cpu or another plan"
            )
        return allowed


def check_contacts(name: str, solver: ContactSolver, count: int, device: Device) -> None:
    """UnsupportedError where a solver does not run elsewhere than on the CPU, or not with so many spheres."""
    if solver.in_turn:
        raise UnsupportedError(
            f"the contact solver {name} runs on the CPU only, not on {device.backend}: {solver.in_turn}; use --backend cpu, "
            "or solver: pairwise"
        )
    if solver.most_elsewhere is not None and count > solver.most_elsewhere:
        raise UnsupportedError(
            f"the contact solver {name} takes up to {solver.most_elsewhere} spheres on {device.backend}, and here are {count}: "
            "more of them run on the CPU only; use --backend cpu, or solver: pairwise"
        )


def check_sines(spec: SceneSpec, forces: Sequence[Any], device: Device) -> None:
    """PrecisionError where a force takes a sine that the backend has not got: kernels of Vulkan have it in f32 alone."""
    for entry, force in zip(spec.forces, forces):
        if force.takes_sine and device.backend == "vulkan" and device.precision == "f64":
            raise PrecisionError(
                f"{entry.name} takes a sine, which vulkan has in f32 alone; use --precision f32 or --backend cpu"
            )


def check_low_parts(spec: SceneSpec, integrator: Any, device: Device) -> None:
    """PrecisionError where not all that moves particles carries the low parts of their positions."""
    refused = None if integrator.takes_low_parts else f"the method {spec.integrator.name}"
    if spec.contacts is not None:
        refused = f"the contact solver {spec.contacts.solver.name}"
    if tree_of(spec) is not None and forces_see_low_parts(device.precision):
        refused = "newtonian_gravity with solver: tree"
    if refused:
        raise PrecisionError(f"{refused} does not carry low parts, so it cannot run in {device.precision}; use f64 or f32")


def check_room(fields: dict[str, tuple[str, int]], *, dimensions: int, replica_count: int, on_cpu: bool) -> None:
    """CapacityError when the work fields of an integrator are more than an index can reach, or than the memory that is left.

    The band of `solver: direct` is what grows faster than the scene: n w numbers for n unknowns of half-bandwidth w. Numbers
    are counted as those of f64.
    """
    numbers = {
        "scalar": 1,
        "vector": dimensions,
        "vector4": 4,
        "vector8": 8,
        "matrix": dimensions**2,
        "index": 0.5,
        "pair": 2,
        "wide": 1,
        "wide_pair": 2,
        "lattice": dimensions,
    }
    needed = {name: count * replica_count * numbers[kind] for name, (kind, count) in fields.items()}
    largest = max(needed, key=lambda name: needed[name], default="")
    hint = "; solver: conjugate_gradients needs none of it" if largest == "band" else ""
    if largest and needed[largest] > LARGEST_COUNT:
        raise CapacityError(f"the work field {largest} has {needed[largest]:,.0f} numbers, allowed: {LARGEST_COUNT:,}{hint}")
    free, total = available_bytes(), 8 * sum(needed.values())
    if on_cpu and free is not None and total > free:
        raise CapacityError(
            f"the integrator's work fields need {total / 2**30:.3g} GiB, most of it for {largest}; "
            f"this machine has {free / 2**30:.3g} GiB available{hint}"
        )
