"""Answers: the file in which a pupil writes predictions, read with the place of every fault."""

import math
from dataclasses import dataclass
from pathlib import Path

from mpp_taichi.errors import MppError
from mpp_taichi.scene.did_you_mean import suggestion
from mpp_taichi.scene.document import Node, read_file
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.worksheets.worksheet import Worksheet, load_worksheet

KEY = "worksheet"
"""The key by which a file of answers is told from a scene."""
KEYS = (KEY, "name", "answers")


@dataclass(frozen=True)
class Answers:
    """A sheet, the name of the person who answers, and question → number; None where a question is not answered."""

    sheet: Worksheet
    name: str
    given: dict[str, float | None]


def template(sheet: Worksheet) -> str:
    """The text of a file without answers."""
    lines = [f"# {sheet.title}. Write a number behind each colon before you run anything, then: mpp-taichi check THIS_FILE"]
    lines += [f"{KEY}: {sheet.name}", "name:", "answers:"]
    for question in sheet.questions:
        unit = f" [{question.unit}]" if question.unit else ""
        lines += ["", f"  # {question.ask}{unit}", f"  {question.name}:"]
    return "\n".join(lines) + "\n"


def is_answers(path: Path) -> bool:
    """Whether a file is a file of answers; a file that cannot be read is none, and is refused as a scene."""
    try:
        with open(path, encoding="utf-8") as lines:
            return any(line.startswith(f"{KEY}:") for _, line in zip(range(1000), lines))
    except (OSError, UnicodeDecodeError):
        return False


def read_answers(path: Path) -> Answers:
    """The answers in a file; SceneError lists every fault with line and column."""
    faults = Faults()
    tree = read_file(path, str(path), faults)
    for key, node in tree.value.items():
        if key not in KEYS:
            faults.add(node.place, key, f"unknown key{suggestion(key, KEYS)}, allowed: {', '.join(KEYS)}")
    sheet = _sheet(tree.value[KEY], faults)
    faults.raise_if_any()
    assert sheet is not None
    given: dict[str, float | None] = dict.fromkeys(question.name for question in sheet.questions)
    entries = tree.get("answers")
    if entries is not None and entries.value is not None and not isinstance(entries.value, dict):
        faults.add(entries.location, "answers", f"must be a mapping of questions to numbers, not {shown(entries.plain())}")
    for key, node in (entries.value or {}).items() if entries is not None and isinstance(entries.value, dict) else ():
        if key not in given:
            faults.add(node.place, f"answers.{key}", f"unknown question{suggestion(key, given)}, allowed: {', '.join(given)}")
        else:
            given[key] = _number(node, f"answers.{key}", faults)
    faults.raise_if_any()
    name = tree.get("name")
    return Answers(sheet, str(name.value) if name is not None and name.value is not None else "", given)


def _sheet(node: Node, faults: Faults) -> Worksheet | None:
    try:
        return load_worksheet(str(node.value))
    except MppError as error:
        faults.add(node.location, KEY, str(error))
        return None


def _number(node: Node, key: str, faults: Faults) -> float | None:
    value = node.value
    if value is None or value == "":
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        faults.add(node.location, key, f"must be a number, not {shown(node.plain())}")
        return None
    return float(value)
