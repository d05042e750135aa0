"""The decades of benchmark_work_precision.py: the fastest run of ours beside the fastest of the other programs."""

import math
from dataclasses import dataclass

from work_precision_ours import is_ours

DECADES = range(2, 13)
LEVEL = 1.1  # a smaller difference is less than the medians of two measurements differ by on a busy machine


@dataclass(frozen=True)
class Decade:
    """The fastest runs of at most an error, as (label, error, seconds) or None, and the contender of `other`."""

    error: float
    ours: tuple | None
    other: tuple | None
    program: str

    @property
    def ratio(self):
        """Time of ours over the time of the other; infinite where only the other reaches the error, 0 where only we do."""
        if self.ours is None:
            return float("inf") if self.other else 1.0
        return self.ours[2] / self.other[2] if self.other else 0.0

    @property
    def ahead(self):
        """Whether we are ahead or level."""
        return self.ratio <= LEVEL


def fastest(rows, error):
    """The fastest run at most so wrong, or None."""
    return min((row for row in rows if row[1] <= error), key=lambda row: row[2], default=None)


def compare(result):
    """The decades of a problem."""
    runs, found = result["runs"], []
    mine = [row for name, rows in runs.items() if is_ours(name) for row in rows]
    for k in DECADES:
        others = {name: fastest(rows, 10.0**-k) for name, rows in runs.items() if not is_ours(name)}
        reached = {name: row for name, row in others.items() if row}
        name = min(reached, key=lambda name: reached[name][2], default="")
        found.append(Decade(10.0**-k, fastest(mine, 10.0**-k), reached.get(name), name.replace("°", "")))
    return found


def show(result):
    """Print the decades of a problem, with every program's own fastest run."""
    runs = result["runs"]
    names = [name for name in runs if not is_ours(name)]
    print(f"\n{result['title']}: ms to an error of the position (reference good to {result['bar']:.1e})")
    print(f"{'error':>6}{'ours':>10}{'/ best':>8}" + "".join(f"{name.removeprefix('rebound ')[:11]:>12}" for name in names))
    for row in compare(result):
        cells = ""
        for name in names:
            found = fastest(runs[name], row.error)
            cells += f"{1e3 * found[2]:12.3f}" if found else f"{'-':>12}"
        own = f"{1e3 * row.ours[2]:10.3f}{row.ratio:8.2f}" if row.ours else f"{'-':>10}{'':8}"
        print(f"{row.error:6.0e}{own}{cells}  {row.ours[0] if row.ours else ''}{'' if row.ahead else '  BEHIND'}", flush=True)


def markdown(results):
    """The table of all problems: our time and the fastest other program's in milliseconds; bold where we are behind."""
    lines = [
        "| error | " + " | ".join(result["title"] for result in results.values()) + " |",
        "|---" * (len(results) + 1) + "|",
    ]
    columns = [compare(result) for result in results.values()]
    for k, rows in zip(DECADES, zip(*columns)):
        power = str(k).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
        lines.append(f"| 10⁻{power} | " + " | ".join(map(_cell, rows)) + " |")
    return "\n".join(lines) + "\n"


def _cell(row):
    own = _milliseconds(row.ours[2]) if row.ours else "–"
    name = {"rebound": "REBOUND", "scipy": "SciPy"}.get(row.program.split(" ")[0], row.program.split(" ")[0])
    method = {"whfast": " WHFast", "saba": " SABA", "ias15": " IAS15", "leapfrog": " leapfrog", "bs": " BS"}
    kind = "".join(method.get(word, "") for word in row.program.split(" ")[1:2])
    other = f"{_milliseconds(row.other[2])} {name}{kind}" if row.other else "–"
    cell = f"{own} : {other}"
    return cell if row.ahead else f"**{cell}**"


def _milliseconds(seconds):
    """With two digits, or the digits before the point."""
    value = 1e3 * seconds
    return f"{value:.{max(0, 1 - math.floor(math.log10(value)))}f}"


def summary(results):
    """How many decades are ahead or level."""
    rows = [row for result in results.values() for row in compare(result)]
    good, reached = sum(row.ahead for row in rows), [row for row in rows if row.ours or row.other]
    verdict = "ok  " if good == len(rows) else "FAIL"
    return (
        f"{verdict} ahead or level (at most {LEVEL} × the time) at {good - len(rows) + len(reached)} of {len(reached)} decades"
    )
