"""Findings: the results of an examination as plain data, the sentence that sums them up, and lines for a terminal."""

import platform
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from mpp_taichi import __version__
from mpp_taichi.device.availability import TAICHI_VERSION, availability
from mpp_taichi.verify.case import GROUPS, Case
from mpp_taichi.verify.case_result import FAILED, NOT_HERE, REFUSED, SOLVED, CaseResult
from mpp_taichi.verify.place import Place

MARKS = {SOLVED: "ok", REFUSED: "refused", FAILED: "FAILED", NOT_HERE: "-"}


def facts(questions: Sequence[tuple[Case, Place]], results: Sequence[CaseResult], missing: dict[str, str]) -> dict[str, Any]:
    """Everything that verify.json has; `missing` are the backends that do not start, with the reason."""
    backends = dict.fromkeys(place.backend for _, place in questions)
    places = dict.fromkeys(f"{place.backend} {place.precision}" for _, place in questions)
    cases = {case.name: case for case, _ in questions}
    counted = Counter(result.status for result in results)
    found: dict[str, Any] = {
        "cases": [
            {"name": case.name, "group": case.group, "title": case.title, "source": case.source} for case in cases.values()
        ],
        "places": list(places),
        "rows": [result.facts() for result in results],
        "counts": {status: counted[status] for status in (SOLVED, REFUSED, FAILED, NOT_HERE)},
        "missing": missing,
        "known": {
            "mpp_taichi": __version__,
            "taichi": TAICHI_VERSION,
            "numpy": np.__version__,
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.machine()}",
            "devices": {backend: availability(backend)["device"] for backend in backends},
        },
        "seconds": sum(result.seconds for result in results),
        "status": "failed" if counted[FAILED] else "ok",
    }
    return found | {"sentence": sentence(found)}


def sentence(found: dict[str, Any]) -> str:
    """How many questions were solved, refused and failed, and on which devices."""
    counts, devices = found["counts"], found["known"]["devices"]
    where = ", ".join(f"{backend} ({device})" for backend, device in devices.items())
    number = len(found["rows"])
    wrong = sorted({row["case"] for row in found["rows"] if row["status"] == FAILED})
    ends = f"{counts[FAILED]} failed: {', '.join(wrong)}" if wrong else "none failed"
    refused = f"{counts[REFUSED]} were refused in words, " if counts[REFUSED] else ""
    absent = f"{counts[NOT_HERE]} could not be asked, " if counts[NOT_HERE] else ""
    return f"of {number} questions on {where}, {counts[SOLVED]} were solved within their bounds, {refused}{absent}{ends}"


def lines(found: dict[str, Any]) -> list[str]:
    """A table: a row for each case, a column for each place with the share of the bound that was reached."""
    rows = {(row["case"], f"{row['backend']} {row['precision']}"): row for row in found["rows"]}
    width = max(len(case["name"]) for case in found["cases"])
    columns = [max(len(place), 8) for place in found["places"]]
    heading = "  ".join(f"{place:>{column}}" for place, column in zip(found["places"], columns))
    told = [f"{'':{width}}  {heading}"]
    for group, title in GROUPS.items():
        cases = [case for case in found["cases"] if case["group"] == group]
        told += [title] if cases else []
        for case in cases:
            cells = [cell(rows.get((case["name"], place))) for place in found["places"]]
            told.append(f"{case['name']:{width}}  " + "  ".join(f"{each:>{column}}" for each, column in zip(cells, columns)))
    told += ["", "  numbers: what was reached, in parts of its bound; refused: the program says in words why not; -: not asked"]
    for row in found["rows"]:
        if row["status"] == FAILED:
            told.append(f"FAIL  {row['case']} on {row['backend']} {row['precision']}: {_failure(row)}")
    return told


def cell(row: dict[str, Any] | None) -> str:
    """`0.04`, `exact`, `refused`, `FAILED` or `-`."""
    if row is None:
        return "-"
    if row["status"] != SOLVED or row["bound"] is None:
        return MARKS[row["status"]]
    return "exact" if row["reached"] == 0.0 else f"{row['reached'] / row['bound']:.2g}"


def _failure(row: dict[str, Any]) -> str:
    if row["reached"] is None:
        return str(row["reason"])
    return f"{row['reached']:.3g} is beyond {row['bound']:.3g}: {row['because']}"
