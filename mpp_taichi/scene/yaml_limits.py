"""Limits of YAML: hostile text is refused by the parser's stream of events, before any value is built.

The parser's events come one at a time and need no recursion, so nesting bombs and alias bombs are stopped at the first event
that breaks a limit; only after that does the composer, which is recursive and in C, read the text.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import yaml

from mpp_taichi.errors import SceneError
from mpp_taichi.scene import yaml_faults

MEBIBYTES_ALLOWED = 32
BYTES_ALLOWED = MEBIBYTES_ALLOWED << 20
TEXT_ALLOWED = 1 << 20  # characters of one value
DEPTH_ALLOWED = 64
NODES_ALLOWED = 200_000  # after every alias is expanded; entries that are alike are read apart from them (rows.py)
ENTRIES_ALLOWED = 200_000  # particles that are written one by one
IN_BULK = "put bulk particles into a .npz or .csv file and name it with particles: - file: {path: …}"
LOADER = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # resolves no scalar: scalars.py does
_NODE_EVENTS = (yaml.ScalarEvent, yaml.SequenceStartEvent, yaml.MappingStartEvent)
_END_EVENTS = (yaml.SequenceEndEvent, yaml.MappingEndEvent)
_NOT_IN_YAML = re.compile(r"[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass
class _Open:
    """A collection that has not ended yet: its anchor, its nodes so far, and the depth of nesting below it."""

    anchor: str | None
    nodes: int = 1
    height: int = 1


def decode(data: bytes, file: str) -> str:
    """Bytes of a scene as text: UTF-8 with or without byte order mark, at most 32 MiB, no control characters."""
    if len(data) > BYTES_ALLOWED:
        raise SceneError(f"{file}:1:1: the file is larger than {MEBIBYTES_ALLOWED} MiB; {IN_BULK}")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        line, column = before.count(b"\n") + 1, error.start - (before.rfind(b"\n") + 1) + 1
        raise SceneError(f"{file}:{line}:{column}: the file is not UTF-8 text (byte {data[error.start]:#04x})") from None
    return check_characters(text, file)


def check_characters(text: str, file: str) -> str:
    """The text, unchanged, if YAML allows every character of it."""
    if (bad := _NOT_IN_YAML.search(text)) is not None:
        before = text[: bad.start()]
        line, column = before.count("\n") + 1, bad.start() - (before.rfind("\n") + 1) + 1
        raise SceneError(f"{file}:{line}:{column}: character U+{ord(bad.group()):04X} is not allowed in a scene")
    return text


def check_events(text: str, file: str) -> None:
    """Refuse bombs, tags, several documents and bad syntax, at the place where a limit is broken."""
    stack: list[_Open] = []
    anchors: dict[str, _Open] = {}
    named: dict[str, int] = {}  # line of each anchor, from 1
    total = documents = 0

    def refuse(event: Any, message: str) -> None:
        raise SceneError(f"{file}:{event.start_mark.line + 1}:{event.start_mark.column + 1}: {message}")

    for event in _events(text, file):
        if isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                refuse(event, "a second document begins here; a scene is one document")
            continue
        kind = type(event)
        if kind is yaml.AliasEvent:
            known = anchors.get(event.anchor)
            if known is None:
                refuse(event, f"alias *{event.anchor[:40]} has no anchor before it, or refers to itself")
            else:
                total += known.nodes
                _close(stack, known)
                if len(stack) + known.height > DEPTH_ALLOWED:
                    refuse(event, f"nested deeper than {DEPTH_ALLOWED} levels")
        elif kind in _NODE_EVENTS:
            if event.tag is not None:
                refuse(event, f"tag {event.tag[:60]} is not allowed: a scene holds plain text, numbers, lists and mappings")
            total += 1
            entry = _Open(event.anchor)
            if event.anchor:
                if event.anchor in named:
                    refuse(event, f"the anchor &{event.anchor[:40]} stands in line {named[event.anchor]} already")
                named[event.anchor] = event.start_mark.line + 1
            if kind is yaml.ScalarEvent:
                if len(event.value) > TEXT_ALLOWED:
                    refuse(event, f"a text of {len(event.value)} characters, allowed: {TEXT_ALLOWED}")
                entry.height = 0
                _name(anchors, entry)
                _close(stack, entry)
            else:
                stack.append(entry)
                if len(stack) > DEPTH_ALLOWED:
                    refuse(event, f"nested deeper than {DEPTH_ALLOWED} levels")
        elif kind in _END_EVENTS:
            entry = stack.pop()
            _name(anchors, entry)
            _close(stack, entry)
        if total > NODES_ALLOWED:
            refuse(event, f"more than {NODES_ALLOWED} values after expanding aliases; {IN_BULK}")


def _events(text: str, file: str) -> Iterator[Any]:
    with syntax_told(text, file):
        yield from yaml.parse(text, Loader=LOADER)


@contextmanager
def syntax_told(text: str, file: str) -> Iterator[None]:
    """A block in which an error of YAML's parser becomes a SceneError with the place and the cause."""
    try:
        yield
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{file}:{mark.line + 1}:{mark.column + 1}" if mark else f"{file}:1:1"
        told = yaml_faults.cause(error, text.splitlines())
        context = f" {error.context}" if error.context else ""
        raise SceneError(f"{place}: not valid YAML: {told or (error.problem or 'cannot be read') + context}") from None
    except yaml.YAMLError as error:
        raise SceneError(f"{file}:1:1: not valid YAML: {str(error).splitlines()[0]}") from None


def _name(anchors: dict[str, _Open], entry: _Open) -> None:
    if entry.anchor:
        anchors[entry.anchor] = entry


def _close(stack: list[_Open], entry: _Open) -> None:
    if stack:
        stack[-1].nodes += entry.nodes
        stack[-1].height = max(stack[-1].height, entry.height + 1)
