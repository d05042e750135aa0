"""Faults of a scene: collected all at once, one line each, with the source line and a caret for the terminal."""

from dataclasses import dataclass, field
from typing import Any

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.location import Location

FAULTS_SHOWN = 100
_VALUE_WIDTH = 60
_LINE_WIDTH = 160


@dataclass
class Faults:
    """Faults found so far, and the texts they were found in (file name → lines)."""

    sources: dict[str, list[str]] = field(default_factory=dict)
    found: list[tuple[Location, str]] = field(default_factory=list)
    more: int = 0  # faults that were counted only
    _settled: set[Location] = field(default_factory=set)

    def settle(self, location: Location, message: str) -> None:
        """Note that the value at this place cannot be read, so that later faults of the same value are not reported."""
        self.add(location, "", message)
        self._settled.add(location)

    def add(self, location: Location, key: str, message: str) -> None:
        """Note `location: key: message`; an empty key is left out."""
        if location in self._settled:
            return
        self.found.append((location, f"{location}: {printable(key)}: {message}" if key else f"{location}: {message}"))

    def raise_if_any(self) -> None:
        """Raise every fault so far as one SceneError, in the order of the file and without repetitions."""
        if not self.found:
            return
        files = list(self.sources)
        order = {name: number for number, name in enumerate(files)}
        unique = list(dict.fromkeys(self.found))
        unique.sort(key=lambda fault: (order.get(fault[0].file, len(files)), fault[0].line, fault[0].column))
        unique, others = _told_once(unique)
        shown = unique[:FAULTS_SHOWN]
        lines = [line + _for_others(others.get(_text_place(location), 0)) for location, line in shown]
        excerpts = [self._excerpt(location) for location, _ in shown]
        if rest := len(unique) - len(shown) + self.more:
            lines.append(f"{shown[-1][0].file}: … and {rest} more faults")
            excerpts.append("")
        raise SceneError(*lines, excerpts=tuple(excerpts))

    def _excerpt(self, location: Location) -> str:
        """The source line and a caret below the column, or nothing where there is no text (a `--set`, a dict)."""
        lines = self.sources.get(location.file, [])
        if not 1 <= location.line <= len(lines):
            return ""
        text = lines[location.line - 1]
        start = max(0, location.column - 1 - _LINE_WIDTH // 2) if len(text) > _LINE_WIDTH else 0
        cut = printable(text[start : start + _LINE_WIDTH], width=_LINE_WIDTH)
        return f"    {cut}\n    {' ' * (location.column - 1 - start)}^"


def _text_place(location: Location) -> tuple[str, int, int]:
    return location.file, location.line, location.column


def _told_once(found: list[tuple[Location, str]]) -> tuple[list[tuple[Location, str]], dict[tuple[str, int, int], int]]:
    """The faults, those of one text of a repeat only for the first values of its variables, and the number of other values."""
    first: dict[tuple[str, int, int], str] = {}
    others: dict[tuple[str, int, int], set[str]] = {}
    kept = []
    for location, line in found:
        place = _text_place(location)
        if location.where and location.line and first.setdefault(place, location.where) != location.where:
            others.setdefault(place, set()).add(location.where)
        else:
            kept.append((location, line))
    return kept, {place: len(values) for place, values in others.items()}


def _for_others(count: int) -> str:
    return f" (so too for {count} other value{'s' if count > 1 else ''})" if count else ""


def printable(text: str, width: int = 200) -> str:
    """Text on one line: control characters and lone surrogates replaced, cut to `width` characters."""
    shortened = text if len(text) <= width else text[: width - 1] + "…"
    return "".join(character if character.isprintable() else " " if character in "\t\n\r" else "�" for character in shortened)


def shown(value: Any) -> str:
    """A value as a message shows it: short, on one line, in YAML's spelling."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    if isinstance(value, int) and abs(value) >= 10**18:
        return f"an integer of {value.bit_length()} bits"
    if isinstance(value, (int, float)):
        return f"{value:.12g}" if isinstance(value, float) else str(value)
    return printable(repr(str(value)[: 2 * _VALUE_WIDTH]), width=_VALUE_WIDTH)
