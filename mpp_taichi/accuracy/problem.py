"""Problem: the scene that is studied, its identity, and the scene with other methods."""

import hashlib
import json
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.accuracy import force_solvers
from mpp_taichi.accuracy.contact_methods import exact_solvers, with_solver
from mpp_taichi.accuracy.method_variants import split_variant
from mpp_taichi.accuracy.stretches import LOOKS, Stretch, own_step, stretches_of
from mpp_taichi.accuracy.wanted import Wanted
from mpp_taichi.component import REQUIRED
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.asked_quantities import tangent_quantities, without_tangent
from mpp_taichi.scene.contacts import merges
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.scene.timeline import time_after
from mpp_taichi.scene.tree_checks import tree_of
from mpp_taichi.scene.wall_motions import walls_with
from mpp_taichi.simulation.course import Phase, phases_of
from mpp_taichi.snapshot import Snapshot

AS_WRITTEN = "as_written"
"""The method of a scene whose phases have different methods: each phase keeps its own, and only steps change."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A scene over a span of time from its start, through the phases of its timeline; its integrators are the scene's own.

    Of a problem that begins later, in phase n, `start` has the particles of this phase, and the time at which it begins.
    """

    spec: SceneSpec
    start: Snapshot
    span: float  # [time]
    phases: tuple[Phase, ...]
    wanted: Wanted | None = None  # the quantity whose error is compared in place of positions

    @cached_property
    def stretches(self) -> tuple[Stretch, ...]:
        """The phases that lie in the span; a scene without a timeline is one stretch."""
        return stretches_of(self.phases, self.start.time, self.start.time + self.span)

    @cached_property
    def different(self) -> tuple[Stretch, ...]:
        """A stretch for each kind of kernels; between the others only sliders move."""
        found = {id(self.phases[stretch.number].kernels): stretch for stretch in reversed(self.stretches)}
        return tuple(reversed(found.values()))

    @property
    def own_dt(self) -> float:
        """The step of the scene's own setting, where the problem begins [time]."""
        return own_step(self.stretches[0].spec)

    @property
    def own_steps(self) -> int:
        """Steps of about the scene's own size that fill the span, a whole number."""
        return sum(steps_of(stretch.span, own_step(stretch.spec)) for stretch in self.stretches)

    @property
    def has_contacts(self) -> bool:
        """Whether spheres touch in any phase."""
        return any(phase.spec.contacts is not None for phase in self.phases)

    @property
    def compares_solvers(self) -> bool:
        """Whether the methods of the problem are contact solvers; else integrators, with the scene's own contacts."""
        return self.has_contacts and not any(_keeps_solver(phase.spec) for phase in self.phases)

    @property
    def samples(self) -> int:
        """Samples in a run of a method that needs no step."""
        return LOOKS if self.wanted is None else self.wanted.samples

    def shortened(self, span: float) -> "Problem":
        """The problem over the first part of its span."""
        return replace(self, span=span)

    def with_method(self, name: str) -> SceneSpec:
        """The whole scene with a method in every phase, by the steps of the scene's own setting."""

        def made(spec: SceneSpec) -> SceneSpec:
            return with_integrator(spec, name, own_step(spec), by_contacts=self.compares_solvers)

        spec = self.spec
        if self.wanted is None or self.wanted.name not in tangent_quantities(spec):
            spec = without_tangent(spec)
        return replace(made(spec), timeline=tuple(replace(event, scene=made(event.scene)) for event in spec.timeline))

    def of_stretch(self, stretch: Stretch, position: np.ndarray, velocity: np.ndarray) -> "Problem":
        """The problem of one stretch alone, which begins at these positions [length] and velocities [length / time]."""
        start = stretch.particles.moved(position=position, velocity=velocity, time=stretch.began, step=0)
        return replace(self, start=start, span=stretch.span)

    @property
    def own_method(self) -> str:
        """The scene's integrator, with the accuracy of a tree in its name; or the solver of a scene with contacts.

        AS_WRITTEN where the phases differ in it, or in its parameters besides dt.
        """
        if self.compares_solvers:
            named = [stretch.spec.contacts for stretch in self.stretches if stretch.spec.contacts is not None]
            found = [(each.solver.name, each.solver.parameters) for each in named]
        else:
            specs = [stretch.spec for stretch in self.stretches]
            found = [(force_solvers.own_name(spec), _besides_step(spec.integrator)) for spec in specs]
        return found[0][0] if all(each == found[0] for each in found) else AS_WRITTEN

    def identity(self) -> str:
        """Hash of the physics: particles, springs, forces and contacts; names, colours, methods and the view do not count.

        With a wanted quantity also of its parameters.

        A force is the same whether it is summed directly or by a tree.

        With a timeline the times and the physics of all phases count, and the parts of the steps that they take.
        """
        digest = hashlib.sha256()
        first, *later = self.stretches
        start = first.particles.moved(position=self.start.position, velocity=self.start.velocity, time=first.began, step=0)
        _digest(digest, first.spec, start)
        for stretch in later:
            _digest(digest, stretch.spec, stretch.particles)
        if later or first.number:
            times = [[stretch.began, stretch.share] for stretch in self.stretches]
            written = [[each.spec.integrator.name, _besides_step(each.spec.integrator)] for each in self.stretches]
            digest.update(json.dumps([times, self.own_method == AS_WRITTEN and written], default=str).encode())
        if self.wanted is not None:
            digest.update(json.dumps(self.wanted.identity(), sort_keys=True, default=str).encode())
        return digest.hexdigest()[:16]


def _besides_step(integrator: ComponentSpec) -> dict[str, Any]:
    return {key: value for key, value in integrator.parameters.items() if key != "dt"}


def _digest(digest: Any, spec: SceneSpec, start: Snapshot) -> None:
    """Add the physics of a phase; the places of particles are those of the first phase, until a run has come to a later one."""
    springs = start.springs
    arrays = (start.position, start.velocity, start.mass, start.charge, start.free)
    for array in (*arrays, springs.between, springs.stiffness, springs.damping, springs.rest_length):
        digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    forces = [[force.name, force.parameters] for force in force_solvers.with_force_solver(spec, None).forces]
    rest: list = [forces, spec.dimensions, spec.spring_damping]
    if spec.contacts is not None:
        digest.update(np.ascontiguousarray(start.radius, dtype=np.float64).tobytes())
        restitution = spec.contacts.solver.parameters.get("restitution")
        walls = [[wall.name, wall.parameters] for wall in spec.walls]
        rest += [restitution, [repr(pair) for pair in spec.contacts.pairs], walls]
        rest += [spec.contacts.solver.name] if _keeps_solver(spec) else []
    digest.update(json.dumps(rest, sort_keys=True, default=str).encode())


def pose(spec: SceneSpec, until: float | None = None, of: str | None = None) -> Problem:
    """The problem that a scene poses; `of` is the quantity of `expect:` that is wanted, None for positions.

    Raises:
        ValueError: the scene does not have this quantity.
        SceneError: methods of different steps cannot be compared in this scene, or the scene has no duration.
    """
    place = spec.integrator.location
    scenes = (spec, *(event.scene for event in spec.timeline))
    for scene in scenes:
        _check_methods(scene)
    kinds = {_keeps_solver(scene) for scene in scenes if scene.contacts is not None}
    if len(kinds) > 1:
        raise SceneError(
            f"{place}: accuracy compares contact solvers, or methods that lead contacts: a timeline has one of both"
        )
    phases = phases_of(spec)
    for phase in phases:
        _check_direct_sums(phase.spec, phase.particles)
    if not any(phase.particles.free.any() for phase in phases):
        raise SceneError(f"{place}: accuracy has nothing to measure: no particle moves")
    if until is None:
        until = spec.run.duration if spec.run.duration is not None else time_after(spec, spec.run.steps or 0)
    if until <= 0.0:
        raise SceneError(f"{place}: the scene has no run.duration: say how long, --until T")
    return Problem(spec, phases[0].particles, until, phases, None if of is None else Wanted.of(spec, of))


def _check_methods(spec: SceneSpec) -> None:
    """Refuse a scene, or a phase of it, whose methods cannot be compared."""
    place = spec.integrator.location
    for _number, entry in spec.driven_entries:
        raise SceneError(f"{entry.location}: accuracy compares methods of which most do not move bodies on a path")
    for _number, entry, _quantity in spec.changing_entries:
        raise SceneError(f"{entry.location}: accuracy compares methods that do not know masses and charges that change")
    if "dt" not in spec.integrator.parameters:
        raise SceneError(f"{place}: accuracy compares steps, and {spec.integrator.name} has no dt")
    for entry in spec.limited_springs:
        raise SceneError(
            f"{entry.location}: accuracy compares motions that are smooth, and springs that break or yield do so at a step: "
            "run the scene with smaller steps instead"
        )
    for _, wall in (*walls_with(spec, "motion"), *walls_with(spec, "turning")):
        raise SceneError(f"{wall.location}: accuracy compares solvers of contacts that do not know the motion of this wall")
    for _, wall in walls_with(spec, "friction"):
        raise SceneError(f"{wall.location}: accuracy compares solvers of contacts that do not know the friction of this wall")
    random = [spec.integrator] if spec.integrator.flag("integrators", "draws_random") else []
    for source in (*random, *spec.thermal_walls):
        raise SceneError(
            f"{source.location}: accuracy compares motions, and {source.name} draws them at random: compare means instead, by "
            "`sweep` over its seed"
        )


def _check_direct_sums(spec: SceneSpec, start: Snapshot) -> None:
    """Refuse trees whose errors cannot be measured."""
    tree = tree_of(spec)
    if tree is None:
        return
    if spec.contacts is not None:
        raise SceneError(f"{tree.location}: accuracy compares solvers of contacts only with the direct sum: solver: direct")
    most, count = force_solvers.MOST_BODIES, start.particle_count
    if count > most:
        rule = f"a tree is measured against the direct sum, of up to {most:,} particles"
        raise SceneError(f"{tree.location}: accuracy: {rule}, not {count:,}: measure a smaller scene like it")


def with_integrator(spec: SceneSpec, name: str, dt: float, *, by_contacts: bool | None = None, **chosen: float) -> SceneSpec:
    """The scene with a method, its defaults and the `chosen` parameters; the scene's own method keeps its parameters.

    `name` is the contact solver of a scene with contacts, and where `by_contacts` says so, of a phase without contacts in such
    a scene; otherwise it may include a tree, see force_solvers, or be a variant, see method_variants.
    """
    own = spec.integrator
    if name == AS_WRITTEN:
        return replace(spec, integrator=replace(own, parameters={**own.parameters, "dt": dt}), accuracy=None)
    if by_contacts is None:
        by_contacts = spec.contacts is not None and not _keeps_solver(spec)
    if by_contacts or name in exact_solvers():
        return replace(with_solver(spec, name, dt), accuracy=None)
    name, tree_accuracy = force_solvers.split(name)
    spec = force_solvers.with_force_solver(spec, tree_accuracy)
    name, varied = split_variant(name)
    given = own.parameters if own.name == name else defaults(name)
    assert given is not None
    return replace(spec, integrator=ComponentSpec(name, {**given, **varied, "dt": dt, **chosen}, own.location), accuracy=None)


def _keeps_solver(spec: SceneSpec) -> bool:
    """Whether contacts go with integrators that are compared: of a solver that leads an adaptive method, or that merges."""
    return spec.contacts is not None and (merges(spec) or bool(spec.contacts.solver.flag("contacts", "leads")))


def defaults(name: str) -> dict | None:
    """Parameters of an integrator besides dt; None where one of them has no default."""
    others = [parameter for parameter in component.declaration("integrators", name).parameters if parameter.name != "dt"]
    if any(parameter.default is REQUIRED for parameter in others):
        return None
    return {parameter.name: parameter.default for parameter in others}


def steps_of(span: float, dt: float) -> int:
    """The number of equal steps of about `dt` that fill the span."""
    return max(1, round(span / dt))
