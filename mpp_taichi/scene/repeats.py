"""Repeats: `repeat: {count: 12, as: i, body: {…}}` in a list of components stands for twelve entries, i = 0 … 11.

They are written out before anything else is checked. Every value keeps the place of its text, and the values of the variables.
"""

import keyword
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from mpp_taichi import component
from mpp_taichi.scene import yaml_limits
from mpp_taichi.scene.did_you_mean import choices
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.expressions import RESERVED
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.fields import Context, Whole, Wrong
from mpp_taichi.scene.messages import key_text
from mpp_taichi.scene.model import KIND_OF_KEY, available
from mpp_taichi.scene.named_numbers import named_numbers
from mpp_taichi.scene.repeat_copies import Copies, Variables, where
from mpp_taichi.scene.repeat_text import USES, Use
from mpp_taichi.scene.repeat_words import COUNT, ENTRIES, KEYS, VARIABLE, VARIABLE_WHEN_ABSENT, WORD

_Path = tuple[Any, ...]


def present(tree: Node) -> bool:
    """Whether a list of the scene has a repeat among its entries."""
    return any(_has_repeat(tree.get(key)) for key in KEYS)


def counts_entries(path: _Path, new: Node) -> bool:
    """Whether a path of `--set` leads to an entry that is counted after the repeats are written out, or to a part of it."""
    return len(path) > 1 and path[0] in KEYS and WORD not in path and new.get(WORD) is None


def expanded(tree: Node, faults: Faults) -> Node:
    """The tree in which the entries of every repeat are written out.

    Raises:
        SceneError: a repeat is at fault, or a constant that it may need; with all faults that were found until now.
    """
    lists = [key for key in KEYS if _has_repeat(tree.get(key))]
    if not lists:
        return tree
    before = len(faults.found)
    constants = named_numbers(tree, faults)
    room = _Room()
    changed = {}
    for key in lists:
        node = tree.value[key]
        entries = _Expansion(KIND_OF_KEY[key], constants, faults, room).written_out(node.value, (key,), {})
        try:
            changed[key] = node.with_value(list(entries))
        except _TooMany:
            break  # the fault is reported
    if len(faults.found) > before:
        faults.raise_if_any()
    return tree.with_value({**tree.value, **changed})


def _has_repeat(node: Node | None) -> bool:
    return node is not None and isinstance(node.value, list) and any(_repeat_of(entry) is not None for entry in node.value)


def _repeat_of(entry: Node) -> Node | None:
    """The repeat that an entry is; None for every other entry."""
    found = entry.get(WORD)
    return found if found is not None and len(entry.value) == 1 else None


class _Room:
    """The values that repeats may still make in this scene."""

    def __init__(self) -> None:
        self.left = yaml_limits.NODES_ALLOWED

    def takes(self, values: int) -> bool:
        self.left -= values
        return self.left >= 0


class _TooMany(Exception):
    """Repeats that make more values than a scene may have; the fault is reported."""


@dataclass(frozen=True)
class _Repeat:
    """A repeat: the name of its variable, the key of its content, and the values that one repetition makes here."""

    variable: str
    word: str
    size: int


class _Expansion:
    """The repeats of one list of a scene."""

    def __init__(self, kind: str, constants: Mapping[str, float | None], faults: Faults, room: _Room) -> None:
        self.kind, self.constants, self.faults, self.room = kind, constants, faults, room
        self.known = [*available(kind), ENTRIES, WORD]
        self.uses: dict[str, Mapping[str, Use]] = {}  # of the parameters of each component
        self.read: dict[int, _Repeat | None] = {}  # by the identity of the node, which stands in the tree of the scene

    def written_out(self, entries: list[Node], path: _Path, variables: Variables) -> Iterator[Node]:
        """The entries of a list, with those of its repeats."""
        for number, entry in enumerate(entries):
            repeat = _repeat_of(entry)
            if repeat is not None:
                yield from self._repeated(repeat, (*path, number, WORD), variables)
            else:
                yield self._entry(entry, (*path, number), variables) if variables else entry

    def _repeated(self, repeat: Node, path: _Path, outer: Variables) -> Iterator[Node]:
        if id(repeat) not in self.read:
            self.read[id(repeat)] = self._read(repeat, path, outer)
        found = self.read[id(repeat)]
        count = None if found is None else self._count(repeat.value[COUNT], (*path, COUNT), outer)
        if found is None or count is None:
            return
        if not self.room.takes(count * found.size):
            told = f"makes {shown(count)} × {found.size} values, and with those of all other repeats more than"
            place = replace(repeat.value[COUNT].location, where=where(outer))
            self.faults.add(place, key_text((*path, COUNT)), f"{told} {yaml_limits.NODES_ALLOWED:,}; {yaml_limits.IN_BULK}")
            raise _TooMany
        content, below = repeat.value[found.word], (*path, found.word)
        for number in range(count):
            variables = {**outer, found.variable: number}
            if found.word == WORD:
                yield from self._repeated(content, below, variables)
            elif found.word == ENTRIES:
                yield from self.written_out(content.value, below, variables)
            else:
                yield self._entry(repeat.with_value({found.word: content}), path, variables)

    def _read(self, repeat: Node, path: _Path, outer: Variables) -> "_Repeat | None":
        """The parts of a repeat that are the same whenever it is written out; None where a fault is reported."""
        before, given, key = len(self.faults.found), repeat.value, key_text(path)
        if not isinstance(given, dict):
            written = "written {count: 12, as: i, name: {parameters}}"
            self.faults.add(repeat.location, key, f"must be a mapping, {written}, not {shown(repeat.plain())}")
            return None
        contents = [each for each in given if each not in (COUNT, VARIABLE)]
        for each in contents:
            if each not in self.known:
                told = choices(each, [*self.known, COUNT, VARIABLE])
                self.faults.add(given[each].place, key_text((*path, each)), f"unknown key {shown(each)}{told}")
        if COUNT not in given:
            self.faults.add(repeat.place, key, f"missing key {COUNT!r} (the number of repetitions)")
        if len(contents) != 1 and len(self.faults.found) == before:
            told = "nothing to repeat" if not contents else f"{len(contents)} things to repeat: {', '.join(contents)}"
            self.faults.add(repeat.place, key, f"has {told}; write one component, or {ENTRIES}: with a list of them")
        if len(self.faults.found) > before:
            return None
        word = contents[0]
        content = given[word]
        variable = self._variable(repeat, path, outer)
        for name in sorted(self._values_of_each_particle(word, content) & {variable, *outer}):
            told = f"{shown(name)} is a value of each particle here, so that a variable needs another name"
            self.faults.add(content.place, key_text((*path, word)), told)
        size = 1 if word == WORD else 1 + _size(content)
        if word == ENTRIES and not isinstance(content.value, list):
            told = f"must be a list of entries, not {shown(content.plain())}"
            self.faults.add(content.location, key_text((*path, word)), told)
        elif word == ENTRIES:
            size = 1 + sum(1 if _repeat_of(entry) is not None else _size(entry) for entry in content.value)
        return None if len(self.faults.found) > before else _Repeat(variable, word, size)

    def _variable(self, repeat: Node, path: _Path, outer: Variables) -> str:
        node = repeat.get(VARIABLE)
        name = VARIABLE_WHEN_ABSENT if node is None else node.value
        told = ""
        if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name):
            told = f"{shown(name)} cannot be a name, allowed: letters, digits and _, a letter first"
        elif name in RESERVED:
            told = f"{shown(name)} means something already, choose another name"
        elif name in self.constants:
            told = f"{shown(name)} is a constant of the scene, choose another name"
        elif name in outer:
            told = f"{shown(name)} is the variable of a repeat around this repeat, choose another name"
        if told:
            self.faults.add((node or repeat).location, key_text((*path, VARIABLE)), told)
        return str(name)

    def _values_of_each_particle(self, word: str, content: Node) -> set[str]:
        """The names that expressions of repeated components may use for a value of each particle, such as u of a lattice."""
        entries = content.value if word == ENTRIES and isinstance(content.value, list) else []
        words = {key for entry in entries if isinstance(entry.value, dict) for key in entry.value} if entries else {word}
        declared = [
            component.declaration(self.kind, each) for each in words if component.find_file(self.kind, each) is not None
        ]
        return {name for each in declared for parameter in each.parameters for name in parameter.names}

    def _count(self, node: Node, path: _Path, outer: Variables) -> int | None:
        try:
            return Whole(minimum=0).check(node.value, Context({**self.constants, **outer}))
        except Wrong as wrong:
            for _, offset, message in wrong.parts:
                self.faults.add(replace(node.place_of(offset), where=where(outer)), key_text(path), message)
            return None

    def _entry(self, entry: Node, path: _Path, variables: Variables) -> Node:
        """A copy of an entry with values for the variables."""
        copy = Copies(variables, self.constants, self.faults)
        if not isinstance(entry.value, dict):
            return copy.of(entry, path, Use.TEXT)
        copied = {}
        for name, body in entry.value.items():
            if name not in self.uses:
                exists = component.find_file(self.kind, name) is not None
                declared = component.declaration(self.kind, name).parameters if exists else ()
                self.uses[name] = {each.name: USES.get(each.type, Use.NUMBER) for each in declared}
            copied[name] = copy.of(body, (*path, name), self.uses[name])
        begins = next(iter(entry.value.values())).place if entry.value else entry.location
        return Node(copied, copy.place(begins))


def _size(node: Node) -> int:
    """The values in a node, itself among them."""
    if isinstance(node.value, dict):
        return 1 + sum(map(_size, node.value.values()))
    return 1 + sum(map(_size, node.value)) if isinstance(node.value, list) else 1
