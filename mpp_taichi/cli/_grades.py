"""The grades of a worksheet, as a table or as JSON."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._terminal import output_reserved, put, put_json, say
from mpp_taichi.errors import StabilityError

if TYPE_CHECKING:
    from mpp_taichi.worksheets.grading import Grade


def put_grades(file: Path, arguments: argparse.Namespace) -> int:
    """Grade the answers in a file; the exit code is 0 where every question is answered right, else that of an expectation."""
    from mpp_taichi.worksheets.answers import read_answers
    from mpp_taichi.worksheets.grading import RIGHT, grade

    answers = read_answers(file)
    with output_reserved(arguments.json):
        told = (lambda _: None) if arguments.quiet else (lambda name: say(f"running what answers {name}"))
        grades = grade(answers, backend=arguments.backend, precision=arguments.precision, told=told)
    right = sum(each.verdict == RIGHT for each in grades)
    code = 0 if right == len(grades) else StabilityError.exit_code
    if arguments.json:
        rows = [_as_json(each) for each in grades]
        status = "ok" if code == 0 else "failed"
        put_json({"worksheet": answers.sheet.name, "name": answers.name, "questions": rows, "right": right, "status": status})
    elif not arguments.quiet:
        put("\n".join(_lines(answers.sheet.title, answers.name, grades, right)))
    return code


def _as_json(each: "Grade") -> dict[str, Any]:
    question = each.question
    return {
        **{"question": question.name, "answer": each.answer, "measured": each.measured, "unit": question.unit},
        **{"within": question.within, "verdict": each.verdict, "because": question.because},
    }


def _lines(title: str, name: str, grades: "list[Grade]", right: int) -> list[str]:
    from mpp_taichi.scene.faults import printable

    lines = [f"{title}{f', {printable(name)}' if name else ''}"]
    for each in grades:
        question = each.question
        if each.measured is None:
            lines.append(f"  {each.verdict:12}  {question.name}: write a prediction first")
            continue
        unit = f" {question.unit}" if question.unit else ""
        lines.append(
            f"  {each.verdict:12}  {question.name}: you say {each.answer:.6g}{unit}, the run says {each.measured:.6g}{unit}"
        )
        lines.append(f"                {question.because}")
    return [*lines, f"{right} of {len(grades)} right"]
