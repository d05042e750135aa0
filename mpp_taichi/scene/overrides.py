"""Overrides: `--set path=value` and the `overrides=` of Python, put into a scene's tree before it is checked.

A path is dotted, `integrator.leapfrog.dt`, with `[0]` or `.0` for the entries of lists, or with the name of the
component where only one entry has this component, `forces.linear_drag.coefficient`, or with the `name:` of an entry,
`particles.planet.mass`. An override sets a key that the scene
has or may have at that place; `+path=value` adds any key. Values are read as in a scene file. A path through a repeat,
`particles.repeat.count`, changes its text; every other path counts entries after the repeats are written out.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from mpp_taichi.errors import SceneError
from mpp_taichi.scene import repeats
from mpp_taichi.scene.did_you_mean import allowed, suggestion
from mpp_taichi.scene.document import Node, from_python, read_value
from mpp_taichi.scene.faults import Faults, printable, shown
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.messages import key_text
from mpp_taichi.scene.model import KIND_OF_KEY

_STEP = re.compile(r"\.?([^.\[\]=]+)|\[([0-9]{1,9})\]")
_MADE_WHEN_ABSENT = (("run",), ("view",), ("view", "camera"), ("record",), ("units",))
Path = tuple[Any, ...]


def apply(tree: Node, overrides: Mapping[str, Any] | Sequence[str], faults: Faults) -> Node:
    """The tree with every override in it; faults are placed at the override."""
    if isinstance(overrides, str):
        overrides = [overrides]
    pairs = overrides.items() if isinstance(overrides, Mapping) else [(text, None) for text in overrides]
    of_entries: list[tuple[Path, bool, Node]] = []

    def set_in(scene: Node, path: Path, adding: bool, new: Node) -> Node:
        try:
            return _put(scene, path, new, adding, ())
        except SceneError as error:
            _note(error, faults)
            return scene

    for written, value in pairs:
        try:
            path, adding, new = _read(str(written), value, from_text=not isinstance(overrides, Mapping))
        except SceneError as error:
            _note(error, faults)
            continue
        if repeats.counts_entries(path, new) and repeats.present(tree):
            of_entries.append((path, adding, new))
        else:
            tree = set_in(tree, path, adding, new)
    if of_entries:
        tree = repeats.expanded(tree, faults)
    for path, adding, new in of_entries:
        tree = set_in(tree, path, adding, new)
    return tree


def _note(error: SceneError, faults: Faults) -> None:
    for fault in error.faults:
        faults.found.append((Location("--set", 0, 0), fault))


def put(tree: Node, written: str, new: Node, faults: Faults) -> Node:
    """The tree with a value from the scene itself at a path; a fault is placed at the value, and then the tree is unchanged."""
    path = steps(written.removeprefix("+").strip())
    try:
        if repeats.counts_entries(path, new):
            tree = repeats.expanded(tree, faults)
        return _put(tree, path, new, written.startswith("+"), ())
    except SceneError as error:
        for fault in error.faults:
            faults.found.append((new.location, fault))
        return tree


def _read(written: str, value: Any, *, from_text: bool) -> tuple[Path, bool, Node]:
    text, equals, value_text = written.partition("=") if from_text else (written, "=", "")
    location = Location(printable(f"--set {written}" if from_text else f"--set {written}={_short(value)}"), 0, 0)
    if not equals:
        raise SceneError(f"{location}: must be path=value, as in integrator.leapfrog.dt=0.01")
    adding = text.startswith("+")
    path = steps(text.removeprefix("+").strip())
    if not path:
        example = "allowed: names with dots and [index], as in particles[0].body.mass"
        raise SceneError(f"{location}: {shown(text)} is no path, {example}")
    if not from_text:
        return path, adding, from_python(value, location)
    try:
        return path, adding, read_value(value_text, location)
    except SceneError as error:
        places = re.compile(re.escape(location.file) + r":\d+:\d+: ")
        raise SceneError(*(places.sub(lambda _: f"{location}: ", fault) for fault in error.faults)) from None


def steps(text: str) -> Path:
    """The steps of a path; empty when the text is no path."""
    found_steps: list[Any] = []
    end = 0
    for found in _STEP.finditer(text):
        if found.start() != end or (found.group(0).startswith(".") == (end == 0) and found.group(1)):
            return ()
        end = found.end()
        found_steps.append(int(found.group(2)) if found.group(2) else found.group(1))
    return tuple(found_steps) if end == len(text) else ()


def _put(node: Node, path: Path, new: Node, adding: bool, walked: Path) -> Node:
    """A copy of the tree with `new` at `path` below `walked`; nodes beside the path are shared."""
    if not path:
        return Node(new.value, new.location, None, new.text_column)
    step, rest = path[0], path[1:]
    where = key_text(walked) or "the scene"
    if isinstance(node.value, list):
        return node.with_value(_put_in_list(node.value, step, rest, new, adding, walked))
    if node.value is None:
        node = node.with_value({})
    if not isinstance(node.value, dict):
        raise SceneError(f"{new.location}: {where} is {shown(node.plain())} and has no {shown(str(step))}")
    key = str(step)
    child = node.value.get(key)
    if child is None:
        if not adding and (not _may_have_more(walked) if not rest else (*walked, key) not in _MADE_WHEN_ABSENT):
            near = suggestion(key, node.value) or f", +{key_text((*walked, *path))}=… adds it,"
            raise SceneError(f"{new.location}: unknown key {shown(key)} in {where}{near} {allowed(node.value)}")
        child = Node(None, new.location)
    return node.with_value({**node.value, key: _put(child, rest, new, adding, (*walked, key))})


def _put_in_list(entries: list[Node], step: Any, rest: Path, new: Node, adding: bool, walked: Path) -> list[Node]:
    text, rest = numbered(str(step), rest, list(map(_names, entries)))
    index = int(text) if text.isascii() and text.isdigit() and len(text) < 10 else -1
    if index == len(entries) and adding:
        return [*entries, _put(Node(None, new.location), rest, new, adding, (*walked, index))]
    if not 0 <= index < len(entries):
        named = sum(entry.get(text) is not None for entry in entries)
        what = f"has {named} entries" if named else "has no entry"
        raise SceneError(f"{new.location}: {key_text(walked)} {what} {shown(text)}{_instead(text, entries)}")
    changed = _put(entries[index], rest, new, adding, (*walked, index))
    return [*entries[:index], changed, *entries[index + 1 :]]


def numbered(text: str, rest: Path, entries: Sequence[Mapping[str, Any]]) -> tuple[str, Path]:
    """A step into a list and the steps after it, with the number of the entry in place of its component or its `name:`.

    `entries` has the keys of each entry, with the `name:` that stands below. Steps that lead to no entry, or to several, stay.
    """
    named = [number for number, names in enumerate(entries) if text in names]
    if len(named) == 1:
        return str(named[0]), (text, *rest)
    called = [(i, key) for i, names in enumerate(entries) if len(names) == 1 for key, name in names.items() if name == text]
    if not named and rest and len(called) == 1:
        ((number, component),) = called
        return str(number), rest if rest[0] == component else (component, *rest)
    return text, rest


def _names(entry: Node) -> dict[str, Any]:
    """The keys of an entry with the names below them. Of a row of a table, which has no names, no value is read."""
    if entry.row is not None:
        return dict.fromkeys(entry.row.shape.keys)
    found: dict[str, Any] = {}
    for key, body in entry.value.items() if isinstance(entry.value, dict) else ():
        given = body.get("name")
        found[key] = None if given is None else given.value
    return found


def _instead(word: str, entries: list[Node]) -> str:
    """The path that the user should write for an entry of a list."""
    names = (
        []
        if any(entry.get(word) for entry in entries)
        else [key for entry in entries if isinstance(entry.value, dict) for key in entry.value]
    )
    return f"{suggestion(word, names) or ','} " + (f"allowed: 0 to {len(entries) - 1}" if entries else "the list is empty")


def _may_have_more(walked: Path) -> bool:
    """Whether the model knows all keys of a place, so that an unknown one is found when the scene is checked."""
    if walked in (("constants",), ("functions",), ("spring_types",), ("expect",), ("integrator",)):
        return False
    return not (len(walked) == 2 and walked[0] in KIND_OF_KEY and isinstance(walked[1], int))


def _short(value: Any) -> str:
    return shown(value) if isinstance(value, (bool, int, float, str)) or value is None else printable(str(value), width=60)
