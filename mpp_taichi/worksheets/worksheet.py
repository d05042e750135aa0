"""Worksheets: for each chapter of the course its goals and its questions, each with the run that answers it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from mpp_taichi.errors import MppError
from mpp_taichi.scene.did_you_mean import suggestion

FOLDER = Path(__file__).parent / "sheets"


@dataclass(frozen=True)
class Question:
    """A number that a pupil predicts.

    name      key of the answer
    ask       the question
    unit      unit of the answer; empty for a pure number
    within    largest relative difference between the answer and the run
    scene     a scene of the program, with the changes `set`, which are those of `--set`
    measure   one entry of `expect:` without a bound: the quantity and its parameters
    because   what explains the number, to be read after the run
    """

    name: str
    ask: str
    unit: str
    within: float
    scene: str
    measure: Mapping[str, Any]
    because: str
    set: Mapping[str, Any]


@dataclass(frozen=True)
class Worksheet:
    """The worksheet of a chapter: title, duration in minutes, what the reader should know before, goals, questions."""

    name: str
    title: str
    minutes: int
    before: str
    goals: tuple[str, ...]
    questions: tuple[Question, ...]


@cache
def worksheet_names() -> tuple[str, ...]:
    """The names of all worksheets, in the order of the chapters."""
    return tuple(path.stem.partition("_")[2] for path in sorted(FOLDER.glob("*.yaml")))


def load_worksheet(name: str) -> Worksheet:
    """The worksheet with this name; MppError where there is none."""
    found = next((path for path in FOLDER.glob("*.yaml") if path.stem.partition("_")[2] == name), None)
    if found is None:
        raise MppError(
            f"there is no worksheet {name!r}{suggestion(name, worksheet_names())}; allowed: {', '.join(worksheet_names())}"
        )
    content = yaml.safe_load(found.read_text(encoding="utf-8"))
    questions = tuple(
        Question(key, **({"unit": "", "set": {}} | question)) for key, question in content.pop("questions").items()
    )
    return Worksheet(name, goals=tuple(content.pop("goals")), questions=questions, **content)
