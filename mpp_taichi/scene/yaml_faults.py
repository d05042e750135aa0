"""Faults of YAML's syntax in the words of a person who writes a scene: what is wrong, and what to write instead.

The parser tells where it stopped and in which construct it was. The usual causes are known from these two places: a tab, a key
without its colon, a bracket or a quote that is not closed, a colon within a text, a colon without a space behind it.
"""

import re
from typing import Any

CLOSING = {"{": "}", "[": "]"}
KEY_WITHOUT_SPACE = re.compile(r"([A-Za-z_]\w*):(?=[\w{\[.+-])")
LONGEST_QUOTE = 40  # characters of a line that a message repeats


def cause(error: Any, lines: list[str]) -> str:
    """What is wrong, for a MarkedYAMLError in a text of these lines; empty where the cause is not known."""
    problem, context = error.problem or "", error.context or ""
    mark, opened = error.problem_mark or error.context_mark, error.context_mark
    if mark is None:
        return ""
    line = lines[mark.line] if mark.line < len(lines) else ""
    here = line[mark.column : mark.column + 1]
    if "cannot start any token" in problem:
        return "a tab; YAML needs spaces here" if here == "\t" else f"a value that begins with {here} needs quotes around it"
    if "scanning a quoted scalar" in context and opened is not None:
        return f"the quote of line {opened.line + 1}, column {opened.column + 1} is not closed"
    if "mapping values are not allowed" in problem:
        return _colon(lines, mark)
    if "flow mapping" in context or "flow sequence" in context:
        return _bracket(lines, mark, opened, line)
    if "unexpected ':'" in problem or "could not find expected ':'" in problem:
        return _key(line, lines, opened)
    if "block collection" in context or "block mapping" in context:
        return _column(mark, opened, what="entries of a list" if "collection" in context else "keys of a mapping")
    return ""


def _colon(lines: list[str], mark: Any) -> str:
    """A colon where no key can be: a second colon in a value, or a line before it that has none."""
    line = lines[mark.line] if mark.line < len(lines) else ""
    first = re.match(r"\s*(?:- +)*([\w.+-]+): +(.*)", line)
    if first is not None and mark.column > first.start(2):
        return f"a text with a colon needs quotes around it: {first[1]}: {_quoted(first[2])}"
    for number in range(mark.line - 1, -1, -1):
        before = lines[number].split("#")[0].strip()
        if before:
            return "" if ":" in before else f"line {number + 1}, {_short(before)}, has no colon behind its key"
    return ""


def _bracket(lines: list[str], mark: Any, opened: Any, line: str) -> str:
    """A bracket that is not closed where something else begins, or a comma that is missing between two entries."""
    if (key := KEY_WITHOUT_SPACE.search(line[: mark.column + 1])) is not None:
        return f"a space belongs behind the colon of {key[1]}:"
    if opened is None or opened.line >= len(lines):
        return ""
    bracket = lines[opened.line][opened.column : opened.column + 1]
    closing = CLOSING.get(bracket, "")
    if not closing:
        return ""
    place = f"line {opened.line + 1}, column {opened.column + 1}"
    if opened.line == mark.line and mark.column < len(line.rstrip()) and line[mark.column] not in "]}":
        return f"a comma is missing before here, in the {bracket} of {place}; a path with [ ] needs quotes inside {{ }}"
    return f"the {bracket} of {place} is not closed by {closing}"


def _key(line: str, lines: list[str], opened: Any) -> str:
    """A colon that is missing, or one that has no space behind it."""
    if (key := KEY_WITHOUT_SPACE.search(line)) is not None:
        return f"a space belongs behind the colon of {key[1]}:"
    if opened is not None and opened.line < len(lines):
        return f"line {opened.line + 1}, {_short(lines[opened.line].strip())}, has no colon behind its key"
    return ""


def _column(mark: Any, opened: Any, *, what: str) -> str:
    """A line whose indentation fits neither to the collection that it is in nor to one around it."""
    if opened is None or opened.column == mark.column:
        return ""
    before = f"the {what} from line {opened.line + 1} on in column {opened.column + 1}"
    return f"this line begins in column {mark.column + 1}, but {before}"


def _quoted(text: str) -> str:
    return f'"{_short(text.strip())[1:-1]}"'


def _short(text: str) -> str:
    return repr(text if len(text) <= LONGEST_QUOTE else text[: LONGEST_QUOTE - 1] + "…")
