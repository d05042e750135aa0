"""Sliders: the parameters that may change while a scene runs, and the scene with other values of these parameters."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from numbers import Real
from typing import Any

from mpp_taichi import component
from mpp_taichi.errors import SceneError
from mpp_taichi.scene import overrides
from mpp_taichi.scene.document import Node, from_python
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.formulas.laws import movable
from mpp_taichi.scene.messages import key_text
from mpp_taichi.scene.spec import ComponentSpec, Event, Location, SceneSpec, SliderSpec, SliderTarget
from mpp_taichi.wording.told_apart import told_apart

SLIDERS_ALLOWED = 24  # the largest number that fits into a window of 720 rows
SPRING_TYPE_PARAMETERS = ("stiffness", "damping", "prestretch")
FOLDERS = {"forces": "forces", "springs": "networks", "integrator": "integrators"}
"""Keys of a scene below which sliders may act, and where their components come from."""
LEAST_SHARE, LARGEST_SHARE = 0.1, 10.0  # of the scene's value: the default ends of a range that cannot include 0


# Sliders from text


def with_sliders(spec: SceneSpec, validated: Any, tree: Node, faults: Faults) -> SceneSpec:
    """The scene with its sliders; each force knows which of its parameters a slider moves."""
    node = tree.get("sliders")
    if node is None or not validated.sliders:
        return spec
    if len(validated.sliders) > SLIDERS_ALLOWED:
        faults.add(node.place, "sliders", f"{len(validated.sliders)} are too many, allowed: {SLIDERS_ALLOWED}")
    found: list[SliderSpec] = []
    for number, (entry, place) in enumerate(zip(validated.sliders, node.value, strict=True)):
        made = _slider(entry, place, f"sliders[{number}]", spec, validated, tree, faults)
        if made is not None and any(made.steps == other.steps for other in found):
            faults.add(place.value["set"].location, f"sliders[{number}].set", f"{made.path} has a slider already, allowed: one")
        elif made is not None and (taken := set(made.keys) & {key for other in found for key in other.keys}):
            faults.add(place.value["keys"].location, f"sliders[{number}].keys", f"another slider has the key {min(taken)}")
        elif made is not None:
            found.append(made)
    forces = tuple(_marked(entry, found) for entry in spec.forces)
    return replace(spec, forces=forces, sliders=tuple(found))


def _marked(entry: ComponentSpec, sliders: Sequence[SliderSpec]) -> ComponentSpec:
    """A force with the names of its parameters that sliders move."""
    targets = [target for slider in sliders for target in slider.targets]
    moved = {target.parameter for target in targets if (target.kind, target.entry) == ("forces", entry.label)}
    return replace(entry, live=tuple(sorted(moved)))


def _slider(entry: Any, node: Node, key: str, spec: SceneSpec, validated: Any, tree: Node, faults: Faults) -> SliderSpec | None:
    said, place = entry.set, node.value["set"].location
    known = {canonical(tree.plain(), path): (path, targets) for path, targets in _movable(spec, validated, tree)}
    steps = canonical(tree.plain(), said)
    if steps not in known:
        before = len(faults.found)
        overrides.put(tree, said, from_python(0.0, place), faults)
        if len(faults.found) == before:
            allowed = ", ".join(path for path, _ in known.values()) or "nothing in this scene"
            what = f"{shown(said)} cannot be moved while the scene runs: its value is compiled, or places particles"
            faults.add(place, f"{key}.set", f"{what}; allowed: {allowed}")
        return None
    path, targets = known[steps]
    value = value_of(spec, targets[0])
    if value is None:
        faults.add(place, f"{key}.set", f"{path} has no value in the scene to begin with")
        return None
    logarithmic = entry.scale == "log"
    low, high = _ends(spec, targets[0], value, logarithmic)
    low, high = (low if getattr(entry, "from") is None else getattr(entry, "from")), (high if entry.to is None else entry.to)
    if not low < high:
        first, last = told_apart(low, high, digits=12)
        faults.add(node.place, key, f"from {first} to {last} is no range, from must be below to")
        return None
    if logarithmic and not min(low, value) > 0.0:
        faults.add(node.place, key, f"a logarithmic scale from {shown(min(low, value))} has no beginning, must be above 0")
        return None
    label = entry.label or key_text(steps[-2:] if isinstance(steps[-1], str) else steps[-3:])
    keys = tuple(entry.keys or ())
    if len(set(keys)) < len(keys):
        faults.add(node.value["keys"].location, f"{key}.keys", f"has the key {keys[0]} twice, must be two keys")
        return None
    return SliderSpec(path, steps, targets, min(low, value), max(high, value), logarithmic, label, node.place, keys)


def _ends(spec: SceneSpec, target: SliderTarget, value: float, logarithmic: bool) -> tuple[float, float]:
    """The default range of a slider."""
    declared = _declared(spec, target)
    if logarithmic or declared.above is not None:
        low, high = LEAST_SHARE * value, (LARGEST_SHARE if logarithmic else 2.0) * value
    else:
        low, high = (min(0.0, 2.0 * value), max(0.0, 2.0 * value)) if value else (0.0, 1.0)
    if declared.maximum is not None:
        high = min(high, declared.maximum)
    if target.kind == "integrator" and spec.run.duration is not None:
        high = min(high, spec.run.duration)
    return low, high


def _declared(spec: SceneSpec, target: SliderTarget) -> component.Parameter:
    name = entry_of(spec, target).name
    if target.kind == "forces":
        return next(each for each in movable(entry_of(spec, target)) if each.name == target.parameter)
    parameters = component.declaration(FOLDERS[target.kind], name).parameters
    return next(each for each in parameters if each.name == target.parameter)


def _movable(spec: SceneSpec, validated: Any, tree: Node) -> Iterator[tuple[str, tuple[SliderTarget, ...]]]:
    """Every path that a slider of this scene may have, with its targets."""
    method = component.declaration("integrators", spec.integrator.name)
    names = [entry.name for entry in spec.forces]
    for number, entry in enumerate(spec.forces) if _forces_may_move(spec, method) else ():
        root = f"forces.{entry.name}" if names.count(entry.name) == 1 else f"forces[{number}].{entry.name}"
        for each in movable(entry):
            if each.type == "Vector":
                for axis in range(spec.dimensions):
                    yield f"{root}.{each.name}[{axis}]", (SliderTarget("forces", entry.label, each.name, axis),)
            else:
                yield f"{root}.{each.name}", (SliderTarget("forces", entry.label, each.name, None),)
    for number, entry in enumerate(spec.springs):
        for each in component.declaration("networks", entry.name).parameters:
            if each.slider and _may_move(entry, each.name):
                yield f"springs[{number}].{entry.name}.{each.name}", (SliderTarget("springs", number, each.name, None),)
    for name in validated.spring_types or {}:
        for parameter in SPRING_TYPE_PARAMETERS:
            said = getattr(validated.spring_types[name], parameter) is not None
            if targets := tuple(_of_type(spec, name, parameter, tree) if said else ()):
                yield f"spring_types.{name}.{parameter}", targets
    if any(each.name == "dt" and not each.optional for each in method.parameters) and tree.get("integrator") is not None:
        yield f"integrator.{method.name}.dt", (SliderTarget("integrator", method.name, "dt", None),)


def _forces_may_move(spec: SceneSpec, method: component.Declaration) -> bool:
    """Whether parameters of forces may change during a run; not where an integrator keeps constants computed from them."""
    return bool(method.flags.get("takes_sliders", True))


def _may_move(entry: ComponentSpec, parameter: str) -> bool:
    """Whether a parameter of springs may change during a run; the rest lengths of springs that break or yield are results."""
    return not entry.has_limits or parameter in ("stiffness", "damping")


def _of_type(spec: SceneSpec, name: str, parameter: str, tree: Node) -> Iterator[SliderTarget]:
    """The entries of `springs:` that take a parameter from their type; the first of them has the type's value."""
    for number, entry in enumerate(spec.springs):
        said = tree.value["springs"].value[number].value[entry.name].value or {}
        takes = parameter in entry.parameters and parameter not in said and _may_move(entry, parameter)
        if entry.parameters.get("type") == name and takes:
            yield SliderTarget("springs", number, parameter, None)


def check_ends(spec: SceneSpec, tree: Node, check: Callable[[Node], SceneSpec]) -> None:
    """Refuse a range if the scene is invalid at one of its ends; SceneError names the slider.

    `check` makes a scene from a tree.
    """
    for number, slider in enumerate(spec.sliders):
        said: Node = tree.value["sliders"].value[number]
        for end, value in (("from", slider.low), ("to", slider.high)):
            node = said.get(end)
            try:
                check(put(tree, slider, spec, value, slider.location if node is None else node.location))
            except SceneError as error:
                raise SceneError(
                    *(f"{fault} (where sliders[{number}] may be moved to)" for fault in error.faults), excerpts=error.excerpts
                ) from None


# Paths and values


def canonical(scene: Any, text: str) -> tuple[Any, ...]:
    """The steps of a path with entries of lists by number; empty where the scene, as plain data, has no such place."""
    found: list[Any] = []
    steps = list(overrides.steps(text.removeprefix("+").strip()))
    while steps:
        step = steps.pop(0)
        if isinstance(scene, list):
            step, rest = overrides.numbered(str(step), tuple(steps), list(map(_names, scene)))
            steps = list(rest)
            if not str(step).isdigit() or int(step) >= len(scene):
                return ()
            step = int(step)
            scene = scene[step]
        elif isinstance(scene, Mapping):
            scene = scene.get(str(step))
        elif scene is None and str(step).isdigit():
            step = int(step)  # of a vector that the scene leaves out
        elif scene is not None:
            return ()
        found.append(step)
    return tuple(found)


def _names(entry: Any) -> dict[str, Any]:
    """The keys of an entry of plain data with the names below them."""
    bodies = entry.items() if isinstance(entry, Mapping) else ()
    return {str(key): body.get("name") if isinstance(body, Mapping) else None for key, body in bodies}


def entry_of(spec: SceneSpec, target: SliderTarget) -> ComponentSpec:
    """The component that a slider acts on."""
    if target.kind == "integrator":
        return spec.integrator
    if isinstance(target.entry, int):
        return spec.springs[target.entry]
    return next(entry for entry in spec.forces if entry.label == target.entry)


def value_of(spec: SceneSpec, target: SliderTarget) -> float | None:
    """The value of a slider's parameter in a scene; None where the scene gives none."""
    value = entry_of(spec, target).parameters[target.parameter]
    return value if target.axis is None or value is None else value[target.axis]


def moved_to(spec: SceneSpec, changes: Mapping[str, Any]) -> dict[SliderSpec, float] | None:
    """The values of the sliders after changes; None unless all changes are finite numbers within the ranges of sliders."""
    known = {slider.steps: slider for slider in spec.sliders}
    found: dict[SliderSpec, float] = {}
    for path, value in changes.items():
        slider = known.get(canonical(spec.resolved, path))
        if slider is None or isinstance(value, bool) or not isinstance(value, Real):
            return None
        if not slider.low <= float(value) <= slider.high:
            return None
        found[slider] = float(value)
    return found or None


def is_set(slider: SliderSpec, event: Event, before: SceneSpec) -> bool:
    """Whether an event gives the parameter of a slider a value of its own; `before` is the scene before the event."""
    paths = (canonical(event.scene.resolved, path) for path in event.changes)
    if any(path and slider.steps[: len(path)] == path for path in paths):
        return True
    known = {each.steps: each for each in event.scene.sliders}
    now = known.get(slider.steps)
    return now is None or value_of(event.scene, now.targets[0]) != value_of(before, slider.targets[0])


def with_values(spec: SceneSpec, values: Mapping[SliderSpec, float]) -> SceneSpec:
    """The scene with other values of its sliders, within their ranges, so that nothing must be checked again."""
    for slider, value in values.items():
        resolved = with_value(spec.resolved, slider, spec, value)
        for target in slider.targets:
            spec = _with_target(spec, target, value)
        spec = replace(spec, resolved=resolved)
    return spec


def _with_target(spec: SceneSpec, target: SliderTarget, value: float) -> SceneSpec:
    entry = entry_of(spec, target)
    new: Any = value
    if target.axis is not None:
        before = entry.parameters[target.parameter]
        new = (*before[: target.axis], value, *before[target.axis + 1 :])
    changed = replace(entry, parameters={**entry.parameters, target.parameter: new})
    if target.kind == "integrator":
        return replace(spec, integrator=changed)
    entries: dict[str, Any] = {target.kind: tuple(changed if one is entry else one for one in getattr(spec, target.kind))}
    return replace(spec, **entries)


def put(tree: Node, slider: SliderSpec, spec: SceneSpec, value: float, place: Location) -> Node:
    """The tree of a scene with another value of a slider; a vector is set as a whole, since the scene may leave it out."""
    path = slider.steps if slider.targets[0].axis is None else slider.steps[:-1]
    new = with_value(tree.plain(), slider, spec, value)
    for step in path:
        new = new[step]
    faults = Faults()
    changed = overrides.put(tree, key_text(path), from_python(new, place), faults)
    faults.raise_if_any()
    return changed


def with_value(scene: Any, slider: SliderSpec, spec: SceneSpec, value: float) -> Any:
    """A scene as plain data with another value of a slider; `spec` has the values that the data may leave out."""

    def put(tree: Any, steps: tuple[Any, ...]) -> Any:
        if not steps:
            return value
        if isinstance(steps[0], int):
            entries = list(entry_of(spec, slider.targets[0]).parameters[slider.targets[0].parameter] if tree is None else tree)
            entries[steps[0]] = put(entries[steps[0]], steps[1:])
            return entries
        return {**(tree or {}), steps[0]: put((tree or {}).get(steps[0]), steps[1:])}

    return put(scene, slider.steps)
