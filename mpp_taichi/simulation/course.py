"""Course: the phases that a run goes through, only on the host; without a timeline there is one phase."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from mpp_taichi.errors import SceneError
from mpp_taichi.scene import sliders
from mpp_taichi.scene.load import change_scene
from mpp_taichi.scene.periodic_forces import acts_across_faces
from mpp_taichi.scene.spec import Event, SceneSpec, SliderSpec
from mpp_taichi.scene.timeline import MOVES_ALLOWED
from mpp_taichi.simulation.constraints import check_on_paths
from mpp_taichi.simulation.first_bad_step import label
from mpp_taichi.snapshot import Rods, Snapshot, Springs
from mpp_taichi.start.assemble import assemble, springs_of
from mpp_taichi.start.contact_setup import enclosure_of
from mpp_taichi.step import plans
from mpp_taichi.walls._base import Enclosure


@dataclass(frozen=True, eq=False)
class Phase:
    """A scene that holds from the time `at` on.

    particles   placed as at the start, with the masses, charges, colours, held axes and springs of this phase
    changes     the parameters that the timeline sets when the phase begins, path → value; empty for the first phase
    kernels     identity of the kernels: the same object as in the phase before where only sliders have moved
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

    @cached_property
    def enclosure(self) -> Enclosure:
        """All walls."""
        return enclosure_of(self.spec)

    @cached_property
    def box(self) -> Enclosure | None:
        """The box that repeats, where pair forces act on the nearest copies of particles."""
        return self.enclosure if acts_across_faces(self.spec) else None

    @property
    def dt(self) -> float:
        """Length of the step that the scene asks for."""
        return float(self.spec.integrator.parameters["dt"])

    @property
    def work(self) -> int:
        """Work of one step, see `step.plans`."""
        return plans.step_work(self.spec, self.particles.particle_count, len(self.particles.springs))


def phases_of(spec: SceneSpec) -> tuple[Phase, ...]:
    """Every phase of a scene, with its particles made and checked before the first begins."""
    phases = [Phase(-math.inf, spec, assemble(spec), {})]
    for event in spec.timeline:
        start = phases[0].particles
        if event.live:
            phases.append(moved_on(phases[-1], event))
            continue
        made = assemble(event.scene, placed_as=spec)
        _check_limits(phases[-1].particles.springs, made.springs, event)
        particles = replace(
            made, position=start.position, velocity=start.velocity * made.moving, rods=_rods_of(phases[-1], made, event)
        )
        phases.append(Phase(event.at, event.scene, particles, event.changes))
    return tuple(phases)


def _check_limits(before: Springs, after: Springs, event: Event) -> None:
    """Refuse a change of springs that may have broken or yielded, of which the rest lengths are results of the run.

    Raises:
        SceneError: the event changes links, rest lengths or limits.
    """
    if not (before.have_limits or after.have_limits):
        return
    for name in ("between", "rest_length", "breaking_length", "yield_stretch"):
        old, new = getattr(before, name), getattr(after, name)
        if old is None or new is None or not np.array_equal(old, new):
            rule = "of springs that break or yield only stiffness and damping may be changed"
            raise SceneError(f"{event.location}: timeline: {rule}")


def _rods_of(before: Phase, made: Snapshot, event: Event) -> Rods:
    """The rods of a phase: of the phase before, all or some, with the lengths that they have.

    Raises:
        SceneError: the event adds a rod, whose length only the run could say.
    """
    known = {tuple(sorted(pair)): k for k, pair in enumerate(before.particles.rods.between.tolist())}
    pairs = [tuple(sorted(pair)) for pair in made.rods.between.tolist()]
    if new := [pair for pair in pairs if pair not in known]:
        ends = " and ".join(label(made, end) for end in new[0])
        raise SceneError(f"{event.location}: timeline: adds a rod between {ends}; a timeline may remove rods, and add none")
    kept = np.array([known[pair] for pair in pairs], dtype=int)
    return replace(made.rods, length=before.particles.rods.length[kept])


def moved_on(before: Phase, event: Event) -> Phase:
    """The phase that begins where sliders move: the same particles and kernels, with other numbers in them."""
    particles = before.particles
    if any(new is not old for new, old in zip(event.scene.springs, before.spec.springs, strict=True)):
        particles = replace(particles, springs=springs_of(event.scene))
    return Phase(event.at, event.scene, particles, event.changes, before.kernels)


def phase_at(phases: Sequence[Phase], time: float) -> int:
    """Number of the phase that a time belongs to; the time of an event belongs to the phase that begins there."""
    return sum(phase.at <= time for phase in phases) - 1


@dataclass(frozen=True, eq=False)
class Course:
    """The phases of a run: phases[k + 1] begins with timeline[k] of the scene. The run begins in phase `first`, at `start`."""

    scene: SceneSpec
    phases: tuple[Phase, ...]
    first: int
    start: Snapshot

    def changed(self, number: int, time: float, given: Mapping[str, Any], *, at_start: bool) -> tuple["Course", int]:
        """The course on which parameters change at a time in the phase `number`, and the number of the phase at that time.

        Before the first step (`at_start`) the change may place the particles anew.

        Raises:
            MppError: there is no such parameter, or it cannot have this value.
        """
        moved = sliders.moved_to(self.phases[number].spec, given)
        if moved is not None:
            return self.moved(number, time, moved)
        scene = change_scene(self.scene, time, given)
        phases = phases_of(scene)
        present = phase_at(phases, time)
        if not at_start:
            return Course(scene, (*self.phases[:present], *phases[present:]), self.first, self.start), present
        made = phases[present].particles
        start = made if self.start is self.phases[self.first].particles else self.start.continuing(made)
        return Course(scene, phases, present, start), present

    def moved(self, number: int, at: float, moved: Mapping[SliderSpec, float]) -> tuple["Course", int]:
        """The course on which sliders move at a time in the phase `number`, and the number of the phase that then begins.

        A move at the time of an event joins this event. Later events keep the parameters that they set themselves.

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
            # Where only sliders have moved, the kernels belong to the phase before, which may be another phase now.
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


def course_of(spec: SceneSpec, start: Snapshot | None) -> Course:
    """The course of a scene from its own start, or from a state of the same particles at the time of that."""
    phases = phases_of(spec)
    first = phase_at(phases, 0.0 if start is None else start.time)
    made = phases[first].particles
    if start is not None:
        check_on_paths(phases[first].spec, start)
    return Course(spec, phases, first, made if start is None else start.continuing(made))
