"""Grading: every question is answered by a run of its scene, beside which the prediction stands as an expectation."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mpp_taichi.report.result import run
from mpp_taichi.worksheets.answers import Answers
from mpp_taichi.worksheets.worksheet import Question

RIGHT, WRONG, OPEN = "right", "not yet", "not answered"


@dataclass(frozen=True)
class Grade:
    """A question, the prediction, the result of the run, and the verdict: `RIGHT`, `WRONG` or `OPEN`.

    A question without a prediction is not run, since its result would be the answer.
    """

    question: Question
    answer: float | None
    measured: float | None
    verdict: str


def grade(
    answers: Answers,
    *,
    backend: str = "auto",
    precision: str | None = None,
    told: Callable[[str], None] = lambda _: None,
) -> list[Grade]:
    """Run the scene of every answered question, and compare; `told` receives the name of each question before its run."""
    found = []
    for question in answers.sheet.questions:
        answer = answers.given[question.name]
        if answer is None:
            found.append(Grade(question, None, None, OPEN))
            continue
        told(question.name)
        measured = measure(question, backend=backend, precision=precision)
        right = abs(answer - measured) <= question.within * abs(measured)
        found.append(Grade(question, answer, measured, RIGHT if right else WRONG))
    return found


def measure(question: Question, *, backend: str = "auto", precision: str | None = None) -> float:
    """The number that a run of the scene gives; MppError where the scene cannot be run or gives no number."""
    [(quantity, parameters)] = question.measure.items()
    entry: dict[str, Any] = {**parameters, "above": -1e300}
    changes = {**question.set, "expect": {quantity: entry}}
    with run(question.scene, overrides=changes, samples=1, backend=backend, precision=precision) as result:
        [verdict] = result.verdicts
        if verdict.value is None:
            raise RuntimeError(f"worksheet question {question.name}: {verdict.reason}")
        return verdict.value
