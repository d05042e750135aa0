"""Rows: the entries of a long list of particles that differ in their numbers and names only, read without YAML's parser.

The text of such an entry with a mark in place of each number is its shape. A scene of 10⁵ bodies has a few shapes; YAML's
parser, which takes 100 µs for a body, reads each shape once. Whatever is not surely of this kind is left to the parser.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from mpp_taichi.errors import SceneError
from mpp_taichi.scene import yaml_limits
from mpp_taichi.scene.scalars import read_plain

FEWEST = 200  # entries: below, the parser is quick enough
SHAPES_ALLOWED = 1000
KEY = "particles"
Path = tuple[Any, ...]
_MARK = "\0"  # a character that no scene may have
_FIRST = re.compile(rf"^{KEY}: *\n(?=( *)- )", re.MULTILINE)
_UNUSUAL = re.compile(r"[^\w ,.:{}\[\]+\-\n]")  # quotes, comments, anchors, block texts, tabs: for the parser
_NUMBER = r"[-+]?(?:(?:0|[1-9][0-9]{0,29})(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]{1,9})?"
_TOKEN = re.compile(rf"((?<=[ \[,]){_NUMBER}|(?<= name: )[^\W0-9]\w*)(?=[ ,\]}}\n]|\Z)")


class NotAlike(Exception):
    """The text is not surely a list of entries that are alike."""


@dataclass(frozen=True, eq=False)
class Shape:
    """What the entries of one shape have in common.

    keys    the keys of an entry
    paths   where the values of a row stand in an entry
    make    makes an entry, as plain data, from the values of a row
    read    makes the tree of an entry from its text and the number of its first line
    parts   the text of an entry between its words
    words   the words of all entries of the list, whatever their shape
    """

    keys: frozenset[str]
    paths: tuple[Path, ...]
    make: Callable[[list[Any]], Any]
    read: Callable[[str, int], Any]
    parts: tuple[str, ...]
    words: list[str]


class Row:
    """One entry: its shape, and its own values."""

    __slots__ = ("_begin", "shape", "values")

    def __init__(self, shape: Shape, values: list[Any], begin: int) -> None:
        """Keep the values; `begin` is the place of the first among the words of the list."""
        self.shape, self.values, self._begin = shape, values, begin

    def plain(self) -> Any:
        """The entry as plain data."""
        return self.shape.make(self.values)

    def read(self, line: int) -> Any:
        """The tree of the entry, by YAML's parser."""
        return self.shape.read(_text(self.shape.parts, self.shape.words, self._begin), line)


@dataclass(frozen=True)
class Cut:
    """A scene without its long list: the text with an empty list in its place, and the entries with their first lines."""

    rest: str
    line: int
    indent: int
    rows: list[tuple[Row, int]]


def cut(text: str, file: str, read: Callable[[str, int], Any]) -> Cut | None:
    """Take the long list of particles out of a scene; None where there is none of entries that are alike.

    `read` makes the tree of an entry from its text and the number of its first line.

    Raises:
        SceneError: an entry is at fault, or there are too many of them.
    """
    first = _FIRST.search(text)
    if first is None:
        return None
    indent, begin = first.group(1), first.end()
    after = re.compile(rf"\n(?!{indent}(?: |- ))").search(text, begin)
    end = len(text) if after is None else after.start() + 1
    count = text.count(f"\n{indent}- ", begin - 1, end)
    if count < FEWEST or _UNUSUAL.search(text, begin, end):
        return None
    if count > yaml_limits.ENTRIES_ALLOWED:
        raise SceneError(f"{file}:1:1: more than {yaml_limits.ENTRIES_ALLOWED} particles in one file; {yaml_limits.IN_BULK}")
    line = text.count("\n", 0, first.start()) + 1
    try:
        found = list(_rows(text[begin:end].removesuffix("\n"), f"{indent}- ", line + 1, read))
    except NotAlike:
        return None
    blank = "\n" * text.count("\n", first.start(), end)
    return Cut(f"{text[: first.start()]}{KEY}: []{blank}{text[end:]}", line, len(indent), found)


def _rows(section: str, dash: str, line: int, read: Callable[[str, int], Any]) -> Iterator[tuple[Row, int]]:
    """The entries of a section with their first lines; `dash` is what each begins with."""
    pieces = _TOKEN.split(section)  # what is between two words, and the word, in turn
    words = pieces[1::2]
    values = [_value(word) for word in words]
    known: dict[str, tuple[Shape, int, int]] = {}
    at = 0
    for text in ("\n" + _MARK.join(pieces[::2])).split("\n" + dash)[1:]:
        found = known.get(text)
        if found is None:
            if len(known) == SHAPES_ALLOWED:
                raise NotAlike
            count = text.count(_MARK)
            shape = _shape(dash + text, words, at, line, read)
            found = known[text] = (shape, count, 1 + text.count("\n"))
        shape, count, lines = found
        yield Row(shape, values[at : at + count], at), line
        at += count
        line += lines


def _value(word: str) -> Any:
    if word[0] not in "+-.0123456789":
        return read_plain(word)
    return int(word) if word.lstrip("+-").isdecimal() else float(word)


def _text(parts: tuple[str, ...], words: list[str], begin: int) -> str:
    """The text of an entry whose words begin at a place among all words."""
    return "".join(part + word for part, word in zip(parts, [*words[begin : begin + len(parts) - 1], ""], strict=True))


def _shape(text: str, words: list[str], begin: int, line: int, read: Callable[[str, int], Any]) -> Shape:
    """The shape of an entry, found by reading one."""
    parts = tuple(text.split(_MARK))
    plain = read(_text(parts, words, begin), line).plain()
    if not isinstance(plain, dict):
        raise NotAlike
    found = [(path, each) for path, each in _leaves(plain, ()) if _is_token(path, each)]
    paths = tuple(path for path, _ in found)
    if [_value(word) for word in words[begin : begin + len(parts) - 1]] != [each for _, each in found]:
        raise NotAlike
    make = _maker(plain, {path: slot for slot, path in enumerate(paths)}, ())
    return Shape(frozenset(plain), paths, make, read, parts, words)


def _leaves(value: Any, path: Path) -> Iterator[tuple[Path, Any]]:
    """The scalars of plain data with their paths, in the order of the text."""
    if isinstance(value, (dict, list)):
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(each, (*path, key))
    else:
        yield path, value


def _is_token(path: Path, value: Any) -> bool:
    """Whether a scalar has a place of its own in each row."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < float("inf")
    return number or path[-1] == "name"


def _maker(value: Any, slots: dict[Path, int], path: Path) -> Callable[[list[Any]], Any]:
    """A function from the values of a row to the plain data at a path."""
    if isinstance(value, dict):
        of_keys = [(key, _maker(each, slots, (*path, key))) for key, each in value.items()]
        return lambda row: {key: make(row) for key, make in of_keys}
    if isinstance(value, list):
        of_items = [_maker(each, slots, (*path, number)) for number, each in enumerate(value)]
        return lambda row: [make(row) for make in of_items]
    slot = slots.get(path)
    return (lambda row: value) if slot is None else (lambda row: row[slot])


def is_placeholder(root: Any, line: int) -> bool:
    """Whether the tree of the rest of a scene has the empty list, as a key of the scene itself, at this line."""
    if not isinstance(root, yaml.MappingNode) or root.flow_style:
        return False
    here = [value for key, value in root.value if key.value == KEY and key.start_mark.line == line - 1]
    return len(here) == 1 and isinstance(here[0], yaml.SequenceNode) and not here[0].value
