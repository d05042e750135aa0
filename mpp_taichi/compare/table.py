"""Table: rows of a comparison as text."""

from collections.abc import Sequence
from typing import Any

from mpp_taichi.accuracy.verdict import duration

_FIRST = ("backend", "", "verdict", "GFLOP/s", "of peak", "rate", "step", "±")
JOULES = "J / step"  # a column more where the machine counts its energy
_LAST = ("launches", "compile", "again", "copy", "off", "allowed", "energy", "decided by")
HEAD = (*_FIRST, *_LAST)
LEFT = 3  # columns that are aligned to the left, and the last
RATES = (
    ("interactions_per_second", "pairs/s"),
    ("springs_per_second", "springs/s"),
    ("particle_steps_per_second", "particles/s"),
)


def head(rows: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """The headings of the columns of these rows."""
    return (*_FIRST, JOULES, *_LAST) if any(row.get("step_joules") is not None for row in rows) else HEAD


def cells(row: dict[str, Any], columns: Sequence[str] = HEAD) -> tuple[str, ...]:
    """A row as the texts of these columns; a row of a missing backend ends with the reason."""
    if row["status"] != "ok":
        return (row["label"], row["precision"] or "", row["status"], row["reason"])
    decided = row.get("decided_by")
    rates = row["rates"]
    rate = next((f"{_short(rates[name])} {unit}" for name, unit in RATES if name in rates), "")
    shares = [rates[name] for name in ("share_of_peak_flops", "share_of_peak_bytes") if name in rates]
    energy = row.get("energy_change")
    launches = row["launches_per_step"]
    joules = row.get("step_joules")
    return (
        row["label"],
        row["precision"],
        row["verdict"],
        f"{rates['flops'] / 1e9:.3g}" if "flops" in rates else "",
        f"{100 * shares[0]:.0f} %" if shares else "",
        rate,
        duration(row["step_seconds"]),
        "" if row["step_spread"] is None else f"{100 * row['step_spread']:.0f} %",
        *(("" if joules is None else f"{joules:.2g}",) if JOULES in columns else ()),
        "" if launches is None else f"{launches:g}",
        duration(row["cold_compile_seconds"]),
        duration(row["warm_compile_seconds"]),
        duration(row["copy_seconds"]),
        number(decided["difference"]) if decided else "",
        number(decided["allowance"]) if decided else "",
        "" if energy is None else number(abs(energy)),
        decided["check"] if decided else row["verdict_reason"],
    )


def lines(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The table, columns aligned; the width of reasons is not limited."""
    columns = head(rows)
    table = [columns, *(cells(row, columns) for row in rows)]
    widths = [max((len(row[k]) for row in table if len(row) == len(columns)), default=0) for k in range(len(columns))]
    widths[:2] = [max(len(row[k]) for row in table) for k in range(2)]
    return [
        "  ".join(
            text.ljust(width) if column < LEFT or column == len(row) - 1 else text.rjust(width)
            for column, (text, width) in enumerate(zip(row, widths))
        ).rstrip()
        for row in table
    ]


def number(value: float | None) -> str:
    """The text of a difference; None stands for a number that is not finite."""
    return "none" if value is None else f"{value:.1e}"


def _short(number: float) -> str:
    for size, unit in ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return f"{number:.3g} "
