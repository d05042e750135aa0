"""Timeline: changes of a scene at given times, as phases that are scenes of their own, each checked before the first begins."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from mpp_taichi.errors import SceneError
from mpp_taichi.scene import overrides, sliders
from mpp_taichi.scene.contacts import merges
from mpp_taichi.scene.did_you_mean import choices
from mpp_taichi.scene.document import Node, from_python
from mpp_taichi.scene.expressions import Formula
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.formulas.fields import FormulaText
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.messages import key_text
from mpp_taichi.scene.spec import Event, SceneSpec, SliderSpec
from mpp_taichi.wording.told_apart import told_apart

EVENTS_ALLOWED = 50  # of phases that change more than parameters of sliders: such a phase is compiled and kept
MOVES_ALLOWED = 100_000  # of sliders
CHANGEABLE = (
    *("constants", "particles", "springs", "spring_types", "spring_damping", "forces", "contacts", "walls", "integrator"),
)
CHANGEABLE_OF_PARTICLES = frozenset({"mass", "charge", "radius", "color", "free", "fixed"})
UNCOUNTABLE = 10**300  # steps, where their number is beyond a float
SAME_TIME = 1e-9  # of a step: the rounding error of a time


def with_phases(
    spec: SceneSpec, times: Sequence[float], tree: Node, faults: Faults, check: Callable[[Node], SceneSpec]
) -> SceneSpec:
    """The scene with every event of its timeline; `times` are the times of the events, `check` makes a scene from a tree.

    Each event changes the scene after the event before it. SceneError has all faults of the first faulty event.
    """
    node = tree.get("timeline")
    if node is None or not times:
        return spec
    _check_times(spec, times, node, faults)
    faults.raise_if_any()
    given = [(at, entry.value["set"], entry.location) for at, entry in zip(times, node.value, strict=True)]
    events = _events(spec, given, without_timeline(tree), faults, check)
    whole = replace(spec, timeline=events)
    _check_steps(whole, node, faults)
    faults.raise_if_any()
    return whole


def with_change(
    spec: SceneSpec, at: float, changes: Node, tree: Node, faults: Faults, check: Callable[[Node], SceneSpec]
) -> SceneSpec:
    """The scene, given with its tree, with one more change at a time that a run has reached, added to an event at that time.

    Later events change the scene after this one. SceneError as for a timeline that the scene had from the beginning, except
    for the length of its run, which the change may exceed.
    """
    given = [(event.at, from_python(event.changes, event.location), event.location) for event in spec.timeline]
    before = [entry for entry in given if entry[0] < at]
    joined = [dict(entry[1].value) for entry in given if entry[0] == at]
    now = Node({**(joined[0] if joined else {}), **changes.value}, changes.location)
    given = [*before, (at, now, changes.location), *(entry for entry in given if entry[0] > at)]
    bare = without_timeline(tree)
    first = check(bare)
    _check_count(first, [entry[1] for entry in given], changes.location, faults)
    faults.raise_if_any()
    events = _events(first, given, bare, faults, check)
    written = [{"at": event.at, "set": event.changes} for event in events]
    return replace(first, timeline=events, resolved={**bare.plain(), "timeline": written})


def without_timeline(tree: Node) -> Node:
    """The tree of the scene without its timeline."""
    return tree.with_value({key: child for key, child in tree.value.items() if key != "timeline"})


def _events(
    spec: SceneSpec,
    given: Sequence[tuple[float, Node, Location]],
    now: Node,
    faults: Faults,
    check: Callable[[Node], SceneSpec],
) -> tuple[Event, ...]:
    """The events of a timeline given as times, settings and places; `now` is the tree before the first event."""
    events: list[Event] = []
    scene = replace(spec, resolved=now.plain())
    pending: dict[SliderSpec, float] = {}  # values of sliders that `now` does not have yet
    for number, (at, changes, location) in enumerate(given):
        key = f"timeline[{number}].set"
        moved = sliders.moved_to(scene, changes.plain())
        if moved is not None:
            scene, pending = sliders.with_values(scene, moved), pending | moved
            events.append(Event(at, changes.plain(), scene, location, live=True))
            continue
        for slider, value in pending.items():
            now = sliders.put(now, slider, scene, value, location)
        now, pending = _changed(now, changes, key, faults), {}
        faults.raise_if_any()
        scene = _checked(now, number, check)
        _check_placement(spec, scene, changes, key, faults)
        faults.raise_if_any()
        events.append(Event(at, changes.plain(), scene, location))
    if not all(event.live for event in events) and any(merges(scene) for scene in (spec, *(event.scene for event in events))):
        what = "cannot be where spheres merge: a later phase would bring back merged spheres"
        faults.add(given[-1][2], "timeline", what)
        faults.raise_if_any()
    return tuple(events)


def _check_times(spec: SceneSpec, times: Sequence[float], node: Node, faults: Faults) -> None:
    _check_count(spec, [entry.value["set"] for entry in node.value], node.location, faults)
    for number, (at, entry) in enumerate(zip(times, node.value, strict=True)):
        place, key = entry.value["at"].location, f"timeline[{number}].at"
        if at <= 0.0 and sliders.moved_to(spec, entry.value["set"].plain()) is None:
            faults.add(place, key, f"{shown(at)} is not allowed, must be above 0")
        elif number and at <= times[number - 1]:
            time, before = told_apart(at, times[number - 1], digits=12)
            faults.add(place, key, f"{time} is not after timeline[{number - 1}].at = {before}")
        elif spec.run.duration is not None and at >= spec.run.duration:
            time, end = told_apart(at, spec.run.duration, digits=12)
            faults.add(place, key, f"{time} is never reached, must be below run.duration = {end}")


def _check_count(spec: SceneSpec, given: Sequence[Node], place: Location, faults: Faults) -> None:
    """Refuse more phases than fit into memory; phases that only move sliders take little."""
    count = sum(sliders.moved_to(spec, changes.plain()) is None for changes in given)
    if count > EVENTS_ALLOWED:
        faults.add(place, "timeline", f"{count} events are too many, allowed: {EVENTS_ALLOWED}")
    elif len(given) > MOVES_ALLOWED:
        faults.add(place, "timeline", f"{len(given)} events are too many, allowed: {MOVES_ALLOWED}")


def _check_steps(spec: SceneSpec, node: Node, faults: Faults) -> None:
    """Refuse events that a run of so many steps never reaches."""
    for number, event in enumerate(spec.timeline):
        taken = step_count(spec, event.at)
        if spec.run.steps is not None and taken >= spec.run.steps:
            place = node.value[number].value["at"].location
            reached = f"{taken} steps lead to it, run.steps = {spec.run.steps}"
            faults.add(place, f"timeline[{number}].at", f"{shown(event.at)} is never reached, must be earlier: {reached}")


def _changed(tree: Node, changes: Node, key: str, faults: Faults) -> Node:
    """The tree with the values of one event in it."""
    for text, value in changes.value.items():
        path = overrides.steps(text.removeprefix("+").strip())
        if not path:
            example = "allowed: names with dots and [index], as in forces.linear_drag.coefficient"
            faults.add(value.place, f"{key}.{text}", f"{shown(text)} is no path, {example}")
        elif path[0] not in CHANGEABLE:
            faults.add(value.place, f"{key}.{text}", f"{shown(path[0])} stays as it is{choices(str(path[0]), CHANGEABLE)}")
        else:
            tree = overrides.put(tree, text, value, faults)
    return tree


def _checked(tree: Node, number: int, check: Callable[[Node], SceneSpec]) -> SceneSpec:
    """The scene of a phase; its faults name the event, since a changed constant may make an earlier line invalid."""
    try:
        return check(tree)
    except SceneError as error:
        raise SceneError(
            *(f"{fault} (from timeline[{number}] on)" for fault in error.faults), excerpts=error.excerpts
        ) from None


def _check_placement(first: SceneSpec, scene: SceneSpec, changes: Node, key: str, faults: Faults) -> None:
    """Refuse a phase with other particles or other initial positions: particles go on from the end of the phase before."""
    if len(scene.particles) != len(first.particles):
        _report(changes, ("particles",), key, "adds or removes particles, their number stays as it is", faults)
        return
    for number, (before, after) in enumerate(zip(first.particles, scene.particles, strict=True)):
        path = ("particles", number)
        if after.name != before.name:
            _report(changes, path, key, f"makes of particles[{number}] another kind of entry, it stays {before.name}", faults)
            continue
        for name, value in after.parameters.items():
            if name not in CHANGEABLE_OF_PARTICLES and not _same(value, before.parameters[name]):
                changed = key_text((*path, after.name, name))
                may = ", ".join(sorted(CHANGEABLE_OF_PARTICLES & after.parameters.keys()))
                message = f"changes {changed}, but particles stay where the motion has brought them, allowed to change: {may}"
                _report(changes, path, key, message, faults)


def _report(changes: Node, path: tuple[Any, ...], key: str, message: str, faults: Faults) -> None:
    """Place a fault at the change whose path is along `path`; otherwise at all changes, since a constant may be the cause."""
    for text, value in changes.value.items():
        steps = tuple(int(step) if str(step).isdigit() else step for step in overrides.steps(text.removeprefix("+")))
        if steps[: len(path)] == path[: len(steps)]:
            faults.add(value.place, f"{key}.{text}", message)
            return
    faults.add(changes.place, key, message)


def _same(one: Any, other: Any) -> bool:
    """Whether two values of a parameter are equal; formulas are compared by their text and their constants."""
    if isinstance(one, Formula) and isinstance(other, Formula):
        return one.expression.text == other.expression.text and one.constants == other.constants
    if isinstance(one, FormulaText) and isinstance(other, FormulaText):
        return str(one) == str(other) and one.constants == other.constants
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other)


# Steps across phases


def whole_steps(span: float, dt: float) -> tuple[int, float]:
    """The number of whole steps of dt in a span of time, and the length of a last, shorter step to its exact end, or 0."""
    whole = math.floor(span / dt * (1.0 + 4e-16) + SAME_TIME)
    rest = span - whole * dt
    return whole, (rest if rest > SAME_TIME * dt else 0.0)


def step_count(spec: SceneSpec, until: float) -> int:
    """Steps that a run from time 0 takes until a time; a step that ends a phase early counts as one."""
    total = 0
    for began, ended, dt in _legs(spec):
        if until <= began:
            break
        span = min(until, ended) - began
        if not math.isfinite(span / dt):
            return UNCOUNTABLE
        whole, rest = whole_steps(span, dt)
        total += whole + (rest > 0.0)
    return total


def time_after(spec: SceneSpec, steps: int, time: float = 0.0) -> float:
    """The time after `steps` steps from `time` on."""
    for began, ended, dt in _legs(spec):
        if time >= ended:
            continue
        began = max(began, time)
        if not math.isfinite(ended):
            return began + steps * dt
        whole, rest = whole_steps(ended - began, dt)
        if steps < whole + (rest > 0.0):
            return began + steps * dt
        steps -= whole + (rest > 0.0)
        time = ended
    return time


def _legs(spec: SceneSpec) -> list[tuple[float, float, float]]:
    """Beginning, end and dt of every phase."""
    times = [0.0, *(event.at for event in spec.timeline), math.inf]
    steps = [float(scene.integrator.parameters["dt"]) for scene in (spec, *(event.scene for event in spec.timeline))]
    return list(zip(times, times[1:], steps))
