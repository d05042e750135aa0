"""Loading: from a file, a dict or a SceneSpec, with overrides, to a checked SceneSpec. Every fault of a scene at once."""

import gc
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from mpp_taichi.scene import (
    bare_names,
    contacts,
    expectations,
    extends,
    inspection,
    intervals,
    messages,
    own_functions,
    references,
    repeats,
    right_half,
    sliders,
    spring_types,
    sweep_model,
    table_columns,
    timeline,
)
from mpp_taichi.scene import overrides as override
from mpp_taichi.scene.acting import acting
from mpp_taichi.scene.bundled import scene_file
from mpp_taichi.scene.cross_checks import check_together
from mpp_taichi.scene.document import Node, from_python, read_file
from mpp_taichi.scene.faults import Faults, printable, shown
from mpp_taichi.scene.fields import Context, Whole, Wrong
from mpp_taichi.scene.formulas import laws
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.model import scene_model, select
from mpp_taichi.scene.named_numbers import named_numbers
from mpp_taichi.scene.row_entries import RowEntries
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec, default_integrator

_Overrides = Mapping[str, Any] | Sequence[str]


def load_scene(
    source: str | Path | Mapping[str, Any] | SceneSpec, *, overrides: _Overrides = (), interval: float | None = None
) -> SceneSpec:
    """Read and check a scene; SceneError lists every fault.

    `source` is a file, the name of a scene that comes with the program ("ring"), the content of a scene, or a SceneSpec.
    `overrides` is a mapping {"integrator.leapfrog.dt": 0.01} or texts "integrator.leapfrog.dt=0.01" (see overrides.py).
    `interval` is the time between samples of a method that takes no equal steps, where the scene gives neither `dt` nor
    `run.duration`; without it such a scene is refused. No particle is made and nothing large is allocated.
    """
    if isinstance(source, SceneSpec) and not overrides:
        return source
    faults = Faults()
    with _collector_paused():
        tree, name, folder = _read(source, faults)
        tree = _override(tree, overrides, faults)
        is_open = interval is not None and intervals.is_open(tree)
        tree = intervals.with_interval(tree, interval) if is_open and interval is not None else tree
        spec = replace(_whole(tree, name, folder, faults), leaves_interval_open=is_open)
        right_half.check(spec, tree, faults, lambda changed: _whole(changed, name, folder, Faults(faults.sources)))
    return spec


def load_resolved(resolved: Mapping[str, Any], source: str, *, overrides: _Overrides = ()) -> SceneSpec:
    """The scene that a SceneSpec held as `resolved`, read from the file `source`; SceneError lists every fault."""
    faults = Faults()
    tree = _override(from_python(dict(resolved), Location(source, 0, 0)), overrides, faults)
    return _whole(tree, source, Path(source).parent, faults)


@contextmanager
def _collector_paused() -> Iterator[None]:
    """Keep Python from looking for cycles among the values of a scene, which takes half of the time where there are 10⁶."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _whole(tree: Node, name: str, folder: Path, faults: Faults) -> SceneSpec:
    """The scene that a tree holds, with its phases."""
    tree = bare_names.expanded(repeats.expanded(own_functions.with_points_of_files(tree, folder, faults), faults))
    spec, times = _check(tree, name, folder, faults)
    sliders.check_ends(spec, timeline.without_timeline(tree), lambda changed: _check(changed, name, folder, Faults())[0])
    return timeline.with_phases(spec, times, tree, faults, lambda changed: _check(changed, name, folder, faults)[0])


def change_scene(spec: SceneSpec, at: float, changes: Mapping[str, Any]) -> SceneSpec:
    """The scene with one more event in its timeline, at a time that a run has reached; SceneError lists every fault.

    Values set at time 0 are overrides of the scene itself.
    """
    if at <= 0.0:
        return load_scene(spec, overrides=changes)
    faults = Faults()
    tree, name, folder = _read(spec, faults)
    given = Node({path: _set(path, value) for path, value in changes.items()}, Location(name, 0, 0))
    return timeline.with_change(spec, at, given, tree, faults, lambda changed: _check(changed, name, folder, faults)[0])


def _set(path: str, value: Any) -> Node:
    """A value from Python as a tree; messages give the path and the value in place of a line of a file."""
    node = from_python(value, Location(printable(f"set {path}"), 0, 0))
    return from_python(node.plain(), Location(printable(f"set {path} = {shown(node.plain())}"), 0, 0))


def _check(tree: Node, name: str, folder: Path, faults: Faults) -> tuple[SceneSpec, list[float]]:
    """The scene of a tree, and the times of its timeline; the phases of the timeline are made later."""
    context, plain = _context(tree, folder, faults), tree.plain()
    model, particles = scene_model(select(plain)), RowEntries(tree, flat=context.dimensions == 2)
    try:
        validated: Any = model.model_validate(particles.for_model(plain), context=context)
    except ValidationError as error:
        messages.report(error, tree, model, faults, particles.place)
        faults.raise_if_any()
        raise  # a fault without a message would be a bug
    faults.raise_if_any()
    made = particles.specifications(validated.particles, _entry)
    spec = _specification(validated, tree, name, context, faults, particles=made, resolved=plain)
    faults.raise_if_any()
    spec = references.resolve(spec, tree, faults)
    check_together(spec, tree, faults)
    faults.raise_if_any()
    return replace(spec, forces=acting(spec.forces)), [event.at for event in validated.timeline]


def _read(source: str | Path | Mapping[str, Any] | SceneSpec, faults: Faults) -> tuple[Node, str, Path]:
    """The tree, the name of the scene in messages, and the folder of its files."""
    if isinstance(source, SceneSpec):
        return from_python(source.resolved, Location(source.source, 0, 0)), source.source, Path(source.source).parent
    if isinstance(source, Mapping):
        here = Path.cwd()
        tree = from_python(source, Location("scene", 0, 0))
        return extends.resolve(tree, here / "scene", here, faults), "scene", here
    path = scene_file(source)
    tree = read_file(path, str(path), faults)
    return extends.resolve(tree, path, path.parent, faults), str(path), path.parent


def _override(tree: Node, given: _Overrides, faults: Faults) -> Node:
    tree = override.apply(bare_names.expanded(tree), given, faults)
    if (node := tree.get("extends")) is not None:
        faults.add(node.location, "extends", "cannot be overridden")
    return tree


def _context(tree: Node, folder: Path, faults: Faults) -> Context:
    """The dimensions, units, constants and functions, which all other checks need."""
    dimensions = tree.get("dimensions")
    try:
        flat = dimensions is not None and Whole(minimum=2, maximum=3).check(dimensions.value, Context()) == 2
    except Wrong:
        flat = False
    constants = named_numbers(tree, faults)
    functions = own_functions.resolve(tree.get("functions"), constants, folder, faults)
    return Context(constants, 2 if flat else 3, folder, functions)


def _specification(
    validated: Any,
    tree: Node,
    name: str,
    context: Context,
    faults: Faults,
    *,
    particles: tuple[ComponentSpec, ...],
    resolved: dict[str, Any],
) -> SceneSpec:
    gravity = context.constants.get("G", 1.0) if validated.units else 1.0
    forces = tuple(_with_gravity(entry, gravity) for entry in _forces(validated, tree, faults))
    spec = SceneSpec(
        source=name,
        title=validated.title,
        dimensions=validated.dimensions,
        seed=validated.seed,
        units=dict(validated.units) if validated.units else None,
        constants={key: value for key, value in context.constants.items() if value is not None},
        particles=particles,
        springs=spring_types.resolve(_entries(validated.springs, tree, "springs"), validated.spring_types or {}, tree, faults),
        spring_damping=validated.spring_damping,
        forces=forces,
        contacts=contacts.specification(validated.contacts, tree.get("contacts")),
        walls=_entries(validated.walls, tree, "walls"),
        integrator=_integrator(validated, tree, faults),
        move_to_center_of_mass=validated.move_to_center_of_mass,
        run=validated.run,
        view=validated.view,
        record=table_columns.build(validated.record, tree.get("record")),
        expect=expectations.build(validated.expect, tree.get("expect"), faults),
        modes=validated.modes,
        inspect=inspection.build(validated.inspect, tree.get("inspect"), faults),
        horizon=validated.horizon,
        accuracy=validated.accuracy,
        resolved=resolved,
    )
    spec = replace(spec, sweep=sweep_model.build(validated.sweep, tree.get("sweep"), spec.expect, faults))
    return sliders.with_sliders(spec, validated, tree, faults)


def _integrator(validated: Any, tree: Node, faults: Faults) -> ComponentSpec:
    """The integrator; a contact solver that flies brings its own, with LOOKS samples in a run where no dt is given."""
    if validated.integrator is not None:
        entry = _entry(validated.integrator, tree.value["integrator"])
    elif contacts.fly(validated.contacts):  # the integrator that goes with them has their name
        entry = ComponentSpec(validated.contacts.hard_spheres.solver, {"dt": None}, tree.value["contacts"].place)
    elif validated.accuracy is not None and validated.run.duration is not None:
        entry = ComponentSpec(
            default_integrator(), {"dt": validated.run.duration / contacts.LOOKS}, tree.value["accuracy"].place
        )
    else:
        faults.add(tree.location, "integrator", "missing key 'integrator' (the method that advances time)")
        return ComponentSpec(default_integrator(), {"dt": 1.0}, tree.location)
    if entry.parameters["dt"] is None:  # of a method that takes no equal steps, dt is the time between two samples
        if validated.run.duration is None:
            faults.add(
                entry.location,
                f"integrator.{entry.name}",
                "needs dt, the time between samples, or run.duration to divide",
            )
            return replace(entry, parameters={**entry.parameters, "dt": 1.0})
        return replace(entry, parameters={**entry.parameters, "dt": validated.run.duration / contacts.LOOKS})
    return entry


def _entries(validated: Sequence[BaseModel], tree: Node, key: str) -> tuple[ComponentSpec, ...]:
    node = tree.get(key)
    return tuple(_entry(entry, place) for entry, place in zip(validated, node.value if node else (), strict=True))


def _forces(validated: Any, tree: Node, faults: Faults) -> list[ComponentSpec]:
    """The forces, with the laws of those that are formulas checked."""
    entries = _entries(validated.forces, tree, "forces")
    spread = [replace(entry, parameters=laws.spread(entry.name, entry.parameters)) for entry in entries]
    laws.check(spread, tree, faults)
    faults.raise_if_any()
    return spread


def _entry(entry: BaseModel, node: Node) -> ComponentSpec:
    (name,) = entry.model_fields_set
    body = getattr(entry, name)
    return ComponentSpec(name, {key: getattr(body, key) for key in type(body).model_fields}, node.value[name].place)


def _with_gravity(entry: ComponentSpec, strength: float | None) -> ComponentSpec:
    """Gravity without a given strength gets the strength of the scene's units, or 1."""
    if not entry.flag("forces", "gravitates") or entry.parameters.get("strength") is not None:
        return entry
    return ComponentSpec(entry.name, {**entry.parameters, "strength": strength}, entry.location)
