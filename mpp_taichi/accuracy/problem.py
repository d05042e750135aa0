"""Problem: the scene that is studied, its identity, and the scene with other methods."""

import hashlib
import json
from dataclasses import dataclass, replace

import numpy as np

from mpp_taichi import component
from mpp_taichi.accuracy import force_solvers
from mpp_taichi.accuracy.contact_methods import with_solver
from mpp_taichi.accuracy.wanted import Wanted
from mpp_taichi.component import REQUIRED
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.contacts import merges
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.scene.timeline import time_after
from mpp_taichi.scene.tree_checks import tree_of
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble

LOOKS = 64  # samples of energies and positions in a run; the steps of a reference are a multiple of this number


@dataclass(frozen=True, eq=False)
class Problem:
    """A scene over a span of time, from its start; the integrator of `spec` is the scene's own."""

    spec: SceneSpec
    start: Snapshot
    span: float  # [time]
    wanted: Wanted | None = None  # the quantity whose error is compared in place of positions

    @property
    def own_dt(self) -> float:
        """The step of the scene's own setting [time]."""
        return float(self.spec.integrator.parameters["dt"])

    @property
    def own_steps(self) -> int:
        """Steps of about the scene's own size that fill the span, a whole number."""
        return steps_of(self.span, self.own_dt)

    @property
    def samples(self) -> int:
        """Samples in a run of a method that needs no step."""
        return LOOKS if self.wanted is None else self.wanted.samples

    def shortened(self, span: float) -> "Problem":
        """The problem over the first part of its span."""
        return replace(self, span=span)

    @property
    def own_method(self) -> str:
        """The scene's integrator, with the accuracy of a tree in its name; or the solver of a scene with contacts."""
        contacts = self.spec.contacts
        return force_solvers.own_name(self.spec) if contacts is None else contacts.solver.name

    def identity(self) -> str:
        """Hash of the physics: particles, springs, forces and contacts; names, colours, methods and the view do not count.

        With a wanted quantity also of its parameters.

        A force is the same whether it is summed directly or by a tree.
        """
        digest = hashlib.sha256()
        springs = self.start.springs
        start = self.start
        arrays = (start.position, start.velocity, start.mass, start.charge, start.free)
        for array in (*arrays, springs.between, springs.stiffness, springs.damping, springs.rest_length):
            digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
        forces = [[force.name, force.parameters] for force in force_solvers.with_force_solver(self.spec, None).forces]
        rest: list = [forces, self.spec.dimensions, self.spec.spring_damping]
        if self.spec.contacts is not None:
            digest.update(np.ascontiguousarray(start.radius, dtype=np.float64).tobytes())
            restitution = self.spec.contacts.solver.parameters.get("restitution")
            walls = [[wall.name, wall.parameters] for wall in self.spec.walls]
            rest += [restitution, [repr(pair) for pair in self.spec.contacts.pairs], walls]
        if self.wanted is not None:
            rest.append(self.wanted.identity())
        digest.update(json.dumps(rest, sort_keys=True, default=str).encode())
        return digest.hexdigest()[:16]


def pose(spec: SceneSpec, until: float | None = None, of: str | None = None) -> Problem:
    """The problem that a scene poses; `of` is the quantity of `expect:` that is wanted, None for positions.

    Raises:
        ValueError: the scene does not have this quantity.
        SceneError: methods of different steps cannot be compared in this scene, or the scene has no duration.
    """
    place = spec.integrator.location
    if merges(spec):
        raise SceneError(f"{place}: accuracy does not measure scenes in which spheres merge")
    if spec.contacts is not None and spec.contacts.solver.flag("contacts", "leads"):
        name, solver = spec.integrator.name, spec.contacts.solver.name
        raise SceneError(f"{place}: accuracy compares steps, and {solver} contacts use the steps of {name}: vary its tolerance")
    if spec.timeline:
        raise SceneError(f"{place}: accuracy does not measure scenes with a timeline; measure each of its phases as a scene")
    if "dt" not in spec.integrator.parameters:
        raise SceneError(f"{place}: accuracy compares steps, and {spec.integrator.name} has no dt")
    start = assemble(spec)
    _check_direct_sums(spec, start)
    if not start.free.any():
        raise SceneError(f"{place}: accuracy has nothing to measure: no particle moves")
    if until is None:
        until = spec.run.duration if spec.run.duration is not None else time_after(spec, spec.run.steps or 0)
    if until <= 0.0:
        raise SceneError(f"{place}: the scene has no run.duration: say how long, --until T")
    return Problem(spec, start, until, None if of is None else Wanted.of(spec, of))


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


def with_integrator(spec: SceneSpec, name: str, dt: float, **chosen: float) -> SceneSpec:
    """The scene with a method, its defaults and the `chosen` parameters; the scene's own method keeps its parameters.

    `name` is the contact solver of a scene with contacts; otherwise it may include a tree, see force_solvers.
    """
    own = spec.integrator
    if spec.contacts is not None:
        return replace(with_solver(spec, name, dt), accuracy=None)
    name, tree_accuracy = force_solvers.split(name)
    spec = force_solvers.with_force_solver(spec, tree_accuracy)
    given = own.parameters if own.name == name else defaults(name)
    assert given is not None
    return replace(spec, integrator=ComponentSpec(name, {**given, "dt": dt, **chosen}, own.location), accuracy=None)


def defaults(name: str) -> dict | None:
    """Parameters of an integrator besides dt; None where one of them has no default."""
    others = [parameter for parameter in component.declaration("integrators", name).parameters if parameter.name != "dt"]
    if any(parameter.default is REQUIRED for parameter in others):
        return None
    return {parameter.name: parameter.default for parameter in others}


def steps_of(span: float, dt: float) -> int:
    """The number of equal steps of about `dt` that fill the span."""
    return max(1, round(span / dt))
