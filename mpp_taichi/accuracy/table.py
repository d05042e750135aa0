"""Table: rows of a study as text for a terminal."""

from collections.abc import Sequence
from typing import Any

from mpp_taichi.accuracy.front import StudyRow
from mpp_taichi.accuracy.verdict import duration

_SETTING = ("", "integrator", "", "dt", "forces", "time")
_CONSERVED = ("energy", "momentum", "ang. mom.")


def head(wanted: str | None, *, joules: bool = False) -> tuple[str, ...]:
    """The names of the columns; a `wanted` quantity of `expect:` takes the place of the positions."""
    errors = ("position", "(rms)") if wanted is None else (wanted,)
    return (*_SETTING, *(("J",) if joules else ()), *errors, *_CONSERVED)


def has_joules(rows: Sequence[StudyRow]) -> bool:
    """Whether the energy of a run was measured."""
    return any(row.sample.joules is not None for row in rows)


def cells(
    row: StudyRow, fronts: dict[str, Sequence[str]], wanted: str | None = None, *, joules: bool = False
) -> tuple[str, ...]:
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
        *(("–" if sample.joules is None else f"{sample.joules:.2g}",) if joules else ()),
        *(str(error) for error in (*errors, row.energy, row.momentum, row.angular_momentum)),
    )


def lines(rows: Sequence[StudyRow], fronts: dict[str, Sequence[str]], wanted: str | None = None) -> list[str]:
    """The table, columns aligned; the width of reasons is not limited."""
    joules = has_joules(rows)
    first = head(wanted, joules=joules)
    table = [first, *(cells(row, fronts, wanted, joules=joules) for row in rows)]
    full = [row for row in table if len(row) == len(first)]
    widths = [max(len(row[column]) for row in full) for column in range(len(first))]
    return [
        "  ".join(_fit(text, width, column) for column, (text, width) in enumerate(zip(row, widths))).rstrip() for row in table
    ]


def key(wanted: str | None = None) -> list[str]:
    """The meaning of the signs and columns of the table, a sentence each."""
    errors = (
        "position: largest error of a particle at the end, relative to the size of the system; (rms): the root mean square of "
        "the errors of all particles."
        if wanted is None
        else f"{wanted}: difference from its reference value, over this value (or absolute, where the value is 0 or an error "
        "itself); of several entries of expect: the largest."
    )
    return [
        "*: on the front of error and time, so that no other run is both faster and more exact.",
        "+: on the front of error and force evaluations.",
        "o: the scene's own setting.",
        errors,
        "energy, momentum, ang. mom.: largest relative error of the run.",
        "≤: at most so much; the reference shows no more.",
        "time: median of the steps without samples.",
    ]


def front_lines(rows: Sequence[StudyRow], verdict: dict[str, Any]) -> list[str]:
    """The table of the front in time, and of the scene's own setting."""
    fronts = {name: verdict.get(f"{name}_front", ()) for name in ("time", "evaluations")}
    shown = [row for row in rows if row.is_own or row.sample.configuration.key in fronts["time"]]
    return lines(shown, fronts) if shown else []


def _fit(text: str, width: int, column: int) -> str:
    return text.ljust(width) if column < 3 else text.rjust(width)
