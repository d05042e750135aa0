"""Table: rows of a study as text for a terminal."""

from collections.abc import Sequence
from typing import Any

from mpp_taichi.accuracy.front import StudyRow
from mpp_taichi.accuracy.verdict import duration

_SETTING = ("", "integrator", "", "dt", "forces", "time")
_CONSERVED = ("energy", "momentum", "ang. mom.")
HEAD = (*_SETTING, "position", "(rms)", *_CONSERVED)


def head(wanted: str | None) -> tuple[str, ...]:
    """The names of the columns; a `wanted` quantity of `expect:` takes the place of the positions."""
    return HEAD if wanted is None else (*_SETTING, wanted, *_CONSERVED)


def cells(row: StudyRow, fronts: dict[str, Sequence[str]], wanted: str | None = None) -> tuple[str, ...]:
    """A row as texts; the first cell holds * for the front in time, + for that in evaluations, o for the scene's own."""
    sample = row.sample
    key = sample.configuration.key
    marks = ("*" if key in fronts["time"] else "") + ("+" if key in fronts["evaluations"] else "") + ("o" if row.is_own else "")
    where = sample.configuration.precision
    if sample.configuration.backend != "cpu":
        where += f" {sample.configuration.backend}"
    if sample.status != "ok":
        return (marks, sample.configuration.integrator, where, f"{sample.dt:.3g}", "", f"{sample.status}: {sample.reason}")
    errors = (row.position, row.position_rms) if wanted is None else (row.wanted,)
    return (
        marks,
        sample.configuration.integrator,
        where,
        sample.setting.removeprefix("dt = "),
        f"{sample.evaluations:,}",
        duration(row.seconds),
        *(str(error) for error in (*errors, row.energy, row.momentum, row.angular_momentum)),
    )


def lines(rows: Sequence[StudyRow], fronts: dict[str, Sequence[str]], wanted: str | None = None) -> list[str]:
    """The table, columns aligned; the width of reasons is not limited."""
    first = head(wanted)
    table = [first, *(cells(row, fronts, wanted) for row in rows)]
    full = [row for row in table if len(row) == len(first)]
    widths = [max(len(row[column]) for row in full) for column in range(len(first))]
    return [
        "  ".join(_fit(text, width, column) for column, (text, width) in enumerate(zip(row, widths))).rstrip() for row in table
    ]


def front_lines(rows: Sequence[StudyRow], verdict: dict[str, Any]) -> list[str]:
    """The table of the front in time, and of the scene's own setting."""
    fronts = {name: verdict.get(f"{name}_front", ()) for name in ("time", "evaluations")}
    shown = [row for row in rows if row.is_own or row.sample.configuration.key in fronts["time"]]
    return lines(shown, fronts) if shown else []


def _fit(text: str, width: int, column: int) -> str:
    return text.ljust(width) if column < 3 else text.rjust(width)
