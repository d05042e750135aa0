"""Document: a scene's text as a tree in which every value remembers where it was written."""

import numbers
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from mpp_taichi.errors import SceneError
from mpp_taichi.scene import rows, yaml_limits
from mpp_taichi.scene.bundled import missing_scene
from mpp_taichi.scene.faults import Faults, printable, shown
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.scalars import read_plain

_DEEPEST_DICT = yaml_limits.DEPTH_ALLOWED

NOT_FOREIGN = ("", ".yaml", ".yml", ".json", ".npz")
"""Suffixes of files that are no files of other programs."""


class Node:
    """A value and its place.

    value          dict of Nodes, list of Nodes, or a scalar; of an entry of a long list it is made when it is first asked for
    location       where the value begins
    key_location   where its key begins, if it has one
    text_column    column of the first character of a text on its line, 0 when the text is escaped or folded
    row            the numbers of an entry of a long list, whose value is made from them; None for every other node
    shifts         (place in the text, place in the file's text) behind every variable of a repeat that its value replaced
    """

    __slots__ = ("_value", "key_location", "location", "row", "shifts", "text_column")

    def __init__(
        self,
        value: Any,
        location: Location,
        key_location: Location | None = None,
        text_column: int = 0,
        row: rows.Row | None = None,
        shifts: tuple[tuple[int, int], ...] = (),
    ) -> None:
        """Keep a value, or the row from which it is made."""
        self._value, self.location, self.key_location = value, location, key_location
        self.text_column, self.row, self.shifts = text_column, row, shifts

    @property
    def value(self) -> Any:
        """The value, which is read from the row where there is one."""
        if self.row is not None and self._value is None:
            self._value = self.row.read(self.location.line).value
        return self._value

    def with_value(self, value: Any) -> "Node":
        """Another value at the same place."""
        return Node(value, self.location, self.key_location, self.text_column)

    @property
    def place(self) -> Location:
        """The place of the key, or of the value when it has no key."""
        return self.key_location or self.location

    def place_of(self, character: int | None) -> Location:
        """The place of a character of the text; the beginning of the value where the text is escaped or folded."""
        if character is None or not self.text_column:
            return self.location
        for here, there in reversed(self.shifts):
            if character >= here:
                character += there - here
                break
        return replace(self.location, column=self.text_column + character)

    def plain(self) -> Any:
        """The value without places, of plain dicts, lists and scalars."""
        if self.row is not None:
            return self.row.plain()
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value

    def get(self, key: str) -> "Node | None":
        """The entry of a mapping; None where the entry is absent or the node is no mapping."""
        if self.row is not None and key not in self.row.shape.keys:
            return None
        return self.value.get(key) if isinstance(self.value, dict) else None

    def along(self, path: tuple[Any, ...]) -> Iterator[tuple[Any, "Node"]]:
        """Walk down a path, yielding (key, Node); absent keys are skipped."""
        node = self
        for key in path:
            child = None
            if isinstance(node.value, dict):
                child = node.value.get(key)
            elif isinstance(node.value, list) and isinstance(key, int) and key < len(node.value):
                child = node.value[key]
            if child is not None:
                node = child
                yield key, node


def read_file(path: Path, file: str, faults: Faults) -> Node:
    """The tree of a YAML file; `file` is the name that messages show."""
    try:
        if not path.is_file():
            raise SceneError(f"{printable(file)}: not a file" if path.exists() else missing_scene(file))
        with open(path, "rb") as stream:
            data = stream.read(yaml_limits.BYTES_ALLOWED + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"{printable(file)}: cannot read the scene: {reason}") from None
    try:
        return read_text(yaml_limits.decode(data, file), file, faults)
    except SceneError as error:
        if path.suffix.lower() in NOT_FOREIGN:
            raise
        convert = f"mpp-taichi convert {printable(file)} {printable(path.with_suffix('.yaml').name)}"
        *others, last = error.faults
        told = f"{last}; of a file of another program, `{convert}` makes a scene"
        raise SceneError(*others, told, excerpts=error.excerpts) from None


def read_text(text: str, file: str, faults: Faults) -> Node:
    """The tree of a YAML text, whose root must be a mapping."""
    text = text.replace("\r\n", "\n")
    faults.sources[file] = text.splitlines()

    def read_entry(written: str, line: int) -> Node:
        """One entry of a long list, read at its own line."""
        own = Faults(faults.sources)
        root = _composed("\n" * (line - 1) + written, file)
        found: Node = _build(root, file, own).value[0]
        own.raise_if_any()
        return found

    in_rows: SceneError | None = None
    try:
        if (cut := rows.cut(text, file, read_entry)) is not None and (tree := _with_rows(cut, file, faults)) is not None:
            return tree
    except SceneError as error:
        in_rows = error
    try:
        root = _composed(text, file)
    except SceneError as error:
        too_many = yaml_limits.IN_BULK in str(error)
        raise (in_rows if in_rows is not None and too_many else error) from None
    if root is None or (isinstance(root, yaml.ScalarNode) and root.value == ""):
        raise SceneError(f"{file}:1:1: the scene is empty; it needs at least particles: and integrator:")
    if not isinstance(root, yaml.MappingNode):
        kind = "a list" if isinstance(root, yaml.SequenceNode) else f"the text {shown(root.value)}"
        raise SceneError(f"{file}:{root.start_mark.line + 1}:1: a scene is a mapping of keys to values, not {kind}")
    return _build(root, file, faults)


def _composed(text: str, file: str) -> Any:
    yaml_limits.check_events(text, file)
    with yaml_limits.syntax_told(text, file):
        return yaml.compose(text, Loader=yaml_limits.LOADER)


def _with_rows(cut: rows.Cut, file: str, faults: Faults) -> Node | None:
    """The tree of a scene from its long list and its rest; None where the rest does not show that the list is one."""
    root = _composed(cut.rest, file)
    if not rows.is_placeholder(root, cut.line):
        return None
    tree, column = _build(root, file, faults), cut.indent + 1
    entries = [Node(None, Location(file, line, column + 2), row=row) for row, line in cut.rows]
    place = tree.value[rows.KEY].key_location
    listed = Node(entries, Location(file, cut.line + 1, column), place)
    return tree.with_value({**tree.value, rows.KEY: listed})


def read_value(text: str, location: Location) -> Node:
    """The tree of one value, as `--set` gives it; every part of it is placed at `location`."""
    faults = Faults()
    root = _composed(yaml_limits.check_characters(text, location.file), location.file)
    node = Node(None, location) if root is None else _placed(_build(root, location.file, faults), location)
    faults.raise_if_any()
    return node


def from_python(value: Any, location: Location, depth: int = 0, key: str = "") -> Node:
    """The tree of a Python value of the same shape as the YAML; tuples and NumPy values are welcome.

    `key` is the path of the value, for the message of a fault.
    """
    if depth > _DEEPEST_DICT:
        raise SceneError(f"{location}: nested deeper than {_DEEPEST_DICT} levels")
    if hasattr(value, "tolist"):  # NumPy arrays and scalars
        value = value.tolist()
    if isinstance(value, Mapping):
        below = f"{key}." if key else ""
        entries = {str(name): from_python(entry, location, depth + 1, f"{below}{name}") for name, entry in value.items()}
        return Node(entries, location)
    if isinstance(value, (list, tuple)):
        return Node([from_python(entry, location, depth + 1, f"{key}[{k}]") for k, entry in enumerate(value)], location)
    if isinstance(value, Path):
        value = str(value)
    if value is not None and not isinstance(value, (bool, str, numbers.Real)):
        raise SceneError(f"{location}: {key and printable(key) + ': '}a {type(value).__name__} cannot stand in a scene")
    return Node(value, location)


def _placed(node: Node, location: Location) -> Node:
    value = node.value
    if isinstance(value, dict):
        value = {key: _placed(child, location) for key, child in value.items()}
    elif isinstance(value, list):
        value = [_placed(child, location) for child in value]
    return Node(value, location)


def _build(node: Any, file: str, faults: Faults, key_location: Location | None = None) -> Node:
    location = _locate(node, file)
    if isinstance(node, yaml.MappingNode):
        return Node(_build_mapping(node, file, faults), location, key_location)
    if isinstance(node, yaml.SequenceNode):
        return Node([_build(child, file, faults) for child in node.value], location, key_location)
    value: Any = node.value
    quotes = 1 if node.style in ("'", '"') else 0
    if node.style in (None, ""):
        try:
            value = read_plain(node.value)
        except ValueError as error:
            faults.settle(location, str(error))
            value = None
    start = location.column - 1 + quotes
    lines = faults.sources.get(file, [])
    exact = location.line <= len(lines) and lines[location.line - 1].startswith(node.value, start)
    return Node(value, location, key_location, start + 1 if exact else 0)


def _build_mapping(node: yaml.MappingNode, file: str, faults: Faults) -> dict[str, Node]:
    entries: dict[str, Node] = {}
    for key_node, value_node in node.value:
        place = _locate(key_node, file)
        if not isinstance(key_node, yaml.ScalarNode) or key_node.value == "":
            faults.add(place, "", "a key must be a word")
            continue
        key = key_node.value
        if key == "<<":
            faults.add(place, "<<", "merge keys are not part of YAML 1.2, use extends: or repeat the lines")
        elif key in entries:
            faults.add(place, key, f"the key {shown(key)} is here twice, first at {entries[key].place}")
        else:
            entries[key] = _build(value_node, file, faults, place)
    return entries


def _locate(node: yaml.Node, file: str) -> Location:
    return Location(file, node.start_mark.line + 1, node.start_mark.column + 1)
