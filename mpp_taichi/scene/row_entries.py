"""Entries in rows: the particles of a long list that are alike are checked together, and one of each shape by its model.

A row whose numbers are outside the range of a parameter goes to the model too, which finds the words for it.
"""

from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.errors import SceneError
from mpp_taichi.scene import yaml_limits
from mpp_taichi.scene.colors import Color
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.fields import LARGEST_NUMBER, Field, InSpace, ListOf, Number, Text
from mpp_taichi.scene.parameters import field_of
from mpp_taichi.scene.rows import KEY, Shape
from mpp_taichi.scene.spec import ComponentSpec

BY_MODEL = 20_000  # entries that pydantic's model checks one by one
_Path = tuple[Any, ...]


class RowEntries:
    """The entries of `particles:` that the model checks, and the others, which need no more than their numbers compared."""

    def __init__(self, tree: Node, *, flat: bool) -> None:
        """Compare the numbers of all rows; `flat`: a scene of dimensions: 2.

        Raises:
            SceneError: more entries differ from each other than can be checked one by one.
        """
        listed = tree.get(KEY)
        self._nodes: list[Node] = listed.value if listed is not None and isinstance(listed.value, list) else []
        by_shape: dict[Shape, list[int]] = {}
        self._by_model: list[int] = []
        for number, node in enumerate(self._nodes):
            if node.row is None:
                self._by_model.append(number)
            else:
                by_shape.setdefault(node.row.shape, []).append(number)
        self._first = {shape: numbers[0] for shape, numbers in by_shape.items()}
        for shape, numbers in by_shape.items():
            good = _all_good(shape, [node.row.values for number in numbers if (node := self._nodes[number]).row], flat)
            self._by_model += [number for number, right in zip(numbers, good, strict=True) if not right or number == numbers[0]]
        self._by_model.sort()
        if by_shape and len(self._by_model) > BY_MODEL:
            place = self._nodes[self._by_model[BY_MODEL]].location
            raise SceneError(
                f"{place}: {KEY}: more than {BY_MODEL} entries that differ in more than their numbers; {yaml_limits.IN_BULK}"
            )

    def for_model(self, plain: dict[str, Any]) -> dict[str, Any]:
        """The scene as plain data, with only those particles that the model checks."""
        if len(self._by_model) == len(self._nodes):
            return plain
        return {**plain, KEY: [plain[KEY][number] for number in self._by_model]}

    def place(self, path: _Path) -> _Path:
        """The path in the scene for a path in the plain data that the model was given."""
        if len(path) > 1 and path[0] == KEY and isinstance(path[1], int):
            return (KEY, self._by_model[path[1]], *path[2:])
        return path

    def specifications(
        self, validated: Sequence[Any], of_model: Callable[[Any, Node], ComponentSpec]
    ) -> tuple[ComponentSpec, ...]:
        """All entries, from those that the model made, each by `of_model`."""
        made = {number: of_model(entry, self._nodes[number]) for number, entry in zip(self._by_model, validated, strict=True)}
        makers = {shape: _maker(shape, made[first].parameters) for shape, first in self._first.items()}
        found = []
        for number, node in enumerate(self._nodes):
            entry = made.get(number)
            if entry is None:
                assert node.row is not None
                shape = node.row.shape
                entry = ComponentSpec(shape.paths[0][0], makers[shape](node.row.values), node.location)
            found.append(entry)
        return tuple(found)


def _all_good(shape: Shape, values: list[list[Any]], flat: bool) -> list[bool]:
    """Whether each row of a shape surely has allowed values."""
    checks = _fields(shape, flat)
    if checks is None:
        return [False] * len(values)
    good = np.ones(len(values), dtype=bool)
    for slot, check in enumerate(checks):
        column = [row[slot] for row in values]
        if isinstance(check, Text):
            good &= np.fromiter((isinstance(each, str) for each in column), bool, len(column))
            continue
        try:
            numbers = np.array(column, dtype=float)
        except (ValueError, TypeError, OverflowError):  # a name that is a number, or none
            return [False] * len(values)
        good &= np.abs(numbers) <= LARGEST_NUMBER
        good &= numbers >= (-np.inf if check.minimum is None else check.minimum)
        good &= numbers <= (np.inf if check.maximum is None else check.maximum)
        good &= numbers > (-np.inf if check.above is None else check.above)
    return good.tolist()


def _fields(shape: Shape, flat: bool) -> list[Number | Text] | None:
    """The check of each value of a row; None where one of them is more than a number, a component of a vector, or a name."""
    found: list[Number | Text] = []
    name = shape.paths[0][0] if shape.paths else ""
    if len(shape.keys) != 1 or component.find_file("generators", name) is None:
        return None
    if not component.flag("generators", name, "one_particle"):
        return None
    known = {each.name: field_of(each) for each in component.declaration("generators", name).parameters}
    for _, key, *rest in shape.paths:
        check = _of_item(known.get(key), rest, flat)
        if check is None:
            return None
        found.append(check)
    return found


def _of_item(check: Field | None, rest: list[Any], flat: bool) -> Number | Text | None:
    if isinstance(check, (InSpace, ListOf, Color)) and len(rest) == 1 and isinstance(check.item, Number):
        in_plane = isinstance(check, InSpace) and flat and rest[0] == 2
        return Number(minimum=0.0, maximum=0.0) if in_plane else check.item
    alone = (isinstance(check, Text) and not check.choices) or isinstance(check, Number)
    return check if alone and not rest else None  # type: ignore[return-value]


def _maker(shape: Shape, of_first: dict[str, Any]) -> Callable[[list[Any]], dict[str, Any]]:
    """A function from the values of a row to the parameters of its entry; `of_first` are those of the first of its shape."""
    vectors: dict[str, dict[int, int]] = {}
    alone: list[tuple[str, int, Callable[[Any], Any]]] = []
    for slot, (_, key, *rest) in enumerate(shape.paths):
        if rest:
            vectors.setdefault(key, {})[rest[0]] = slot
        else:
            alone.append((key, slot, str if isinstance(of_first[key], str) else float))
    together = [(key, _vector(of_first[key], slots)) for key, slots in vectors.items()]

    def make(values: list[Any]) -> dict[str, Any]:
        made = dict(of_first)
        for key, vector in together:
            made[key] = vector(values)
        for key, slot, kind in alone:
            made[key] = kind(values[slot])
        return made

    return make


def _vector(of_first: tuple[float, ...], slots: dict[int, int]) -> Callable[[list[Any]], tuple[float, ...]]:
    """A function from the values of a row to a vector, whose other components are those of the first of the shape."""
    if list(slots) == [0, 1, 2] == list(range(len(of_first))):
        three = itemgetter(*slots.values())
        return lambda values: tuple(map(float, three(values)))
    return lambda values: tuple(float(values[slots[i]]) if i in slots else each for i, each in enumerate(of_first))
