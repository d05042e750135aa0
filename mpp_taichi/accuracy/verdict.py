"""Verdict: the result of a study, as numbers and as one plain sentence."""

import math
from collections.abc import Sequence
from typing import Any

from mpp_taichi.accuracy.front import StudyRow, evaluation_front, price_of_a_digit, time_front
from mpp_taichi.accuracy.sample import MeasuredError, rounded_up

TEN = 10.0  # times less and more time, of which the sentence says the error
FILM = 1e-3  # of the system's size: less than a pixel of a picture of 1280 × 720 that shows the whole system
ALIKE = 1.1  # ratio of times that medians on a busy machine cannot distinguish


def verdict(rows: Sequence[StudyRow], quantity: str | None, target: float) -> dict[str, Any]:
    """The numbers in the sentence.

    time_per_digit, evaluations_per_digit   factors for ten times less error, along the front
    choice       the row to take for the target, see `choice`; absent where none reaches it
    best         the smallest error of all rows, where no row reaches the target
    faster, slower  the smallest error in a tenth of the time of the choice, and in ten times its time; absent without a row
    elsewhere    for each other backend with rows the row to take for the target there; absent where none reaches it
    missed       for each other backend where no row reaches it, the row with the smallest error
    precisions   for each other precision with rows on the backend of the choice the row to take there; absent as above
    too_rounded  the precisions among these in which no row reaches it
    film         the row to take for FILM of positions in every frame, which is all that an eye sees, with its largest error
                 over the run, `along`; absent for targets near it
    own          the scene's own setting: its error, and `step_ratio`, the factor by which its step could be longer (above 1)
                 or must be shorter (below 1) for the target, from the errors of its own method
    """
    if quantity is None:
        return {"target": target, "quantity": None}
    found: dict[str, Any] = {"target": target, "quantity": quantity}
    for name, rows_of_front, cost in (
        ("time", time_front(rows, quantity), lambda row: row.seconds),
        ("evaluations", evaluation_front(rows, quantity), lambda row: float(row.sample.evaluations)),
    ):
        told = [row for row in rows_of_front if row.error(quantity).value is not None]
        errors = [row.error(quantity).bound for row in told]
        found[f"{name}_per_digit"] = price_of_a_digit(errors, [cost(row) for row in told])
        found[f"{name}_front"] = [row.sample.configuration.key for row in rows_of_front]
    if (chosen := choice(rows, quantity, target)) is not None:
        found["choice"] = _described(chosen, quantity)
        for name, times in (("faster", 1.0 / TEN), ("slower", TEN)):
            if (other := _best_within(rows, quantity, times * (chosen.seconds or math.inf))) is not None:
                found[name] = _described(other, quantity)
        found["elsewhere"], found["missed"] = _elsewhere(rows, quantity, target, chosen)
        found["precisions"], found["too_rounded"] = _in_other_precisions(rows, quantity, target, chosen)
        shown = [row for row in rows if row.sample.along is not None and row.sample.along <= FILM]
        if quantity == "position" and target * TEN <= FILM and (enough := choice(shown, quantity, FILM)) is not None:
            found["film"] = {**_described(enough, quantity), "along": enough.sample.along}
    elif ends := time_front(rows, quantity):
        found["best"] = _described(ends[-1], quantity)
    own = next((row for row in rows if row.is_own), None)
    if own is not None:
        ratio = step_ratio(own, rows, quantity, target)
        found["own"] = {**_described(own, quantity), "status": own.sample.status, "step_ratio": ratio}
    return found


def choice(rows: Sequence[StudyRow], quantity: str, target: float) -> StudyRow | None:
    """The row with the smallest error among the rows that reach the target in at most ALIKE times the shortest median time."""
    reached = [row for row in rows if row.sample.status == "ok" and row.seconds and row.error(quantity).bound <= target]
    if not reached:
        return None
    fastest = min(row.seconds or math.inf for row in reached)
    alike = [row for row in reached if (row.seconds or math.inf) <= ALIKE * fastest]
    return min(alike, key=lambda row: (row.error(quantity).bound, row.sample.evaluations, row.seconds))


def _elsewhere(
    rows: Sequence[StudyRow], quantity: str, target: float, chosen: StudyRow
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The choice on every other backend that was tried; and the smallest error on backends where no row reaches the target."""
    here = chosen.sample.configuration.backend
    reached, missed = [], []
    for backend in dict.fromkeys(row.sample.configuration.backend for row in rows):
        group = [row for row in rows if row.sample.configuration.backend == backend]
        if backend == here:
            continue
        if (found := choice(group, quantity, target)) is not None:
            reached.append(_described(found, quantity))
        elif ends := time_front(group, quantity):
            missed.append(_described(ends[-1], quantity))
    return reached, missed


def _in_other_precisions(
    rows: Sequence[StudyRow], quantity: str, target: float, chosen: StudyRow
) -> tuple[list[dict[str, Any]], list[str]]:
    """The choice in every other precision on the same backend; and the precisions in which no row reaches the target."""
    here = chosen.sample.configuration
    mine = [row for row in rows if row.sample.configuration.backend == here.backend]
    reached, missed = [], []
    for precision in dict.fromkeys(row.sample.configuration.precision for row in mine):
        group = [row for row in mine if row.sample.configuration.precision == precision]
        if precision == here.precision:
            continue
        if (found := choice(group, quantity, target)) is not None:
            reached.append(_described(found, quantity))
        elif any(row.sample.status == "ok" for row in group):
            missed.append(precision)
    return reached, missed


def _best_within(rows: Sequence[StudyRow], quantity: str, seconds: float) -> StudyRow | None:
    """The row with the smallest error among the rows that take at most so many seconds."""
    affordable = [row for row in time_front(rows, quantity) if (row.seconds or math.inf) <= seconds]
    return min(affordable, key=lambda row: row.error(quantity).bound, default=None)


def step_ratio(own: StudyRow, rows: Sequence[StudyRow], quantity: str, target: float) -> float | None:
    """The step that the scene's own method needs for the target over the scene's own step.

    Between two measured steps, the error is taken to be a power of the step; None where the target is not between two errors.
    """
    mine = own.sample.configuration
    points = []
    for row in rows:
        theirs = row.sample.configuration
        same = (theirs.integrator, theirs.precision, theirs.backend) == (mine.integrator, mine.precision, mine.backend)
        if same and row.error(quantity).value is not None:
            points.append((row.sample.dt, row.error(quantity).bound))
    points.sort(reverse=True)
    for (coarse_dt, coarse), (fine_dt, fine) in zip(points, points[1:]):
        if fine <= target <= coarse:
            power = math.log(coarse / fine) / math.log(coarse_dt / fine_dt) if coarse > fine else math.inf
            return fine_dt * (target / fine) ** (1.0 / power) / own.sample.dt
    return None


def _described(row: StudyRow, quantity: str) -> dict[str, Any]:
    configuration, error = row.sample.configuration, row.error(quantity)
    return {
        "key": configuration.key,
        "integrator": configuration.integrator,
        "precision": configuration.precision,
        "backend": configuration.backend,
        "dt": row.sample.dt,
        "setting": row.sample.setting,
        "seconds": row.seconds,
        "joules": row.sample.joules,
        "evaluations": row.sample.evaluations,
        "error": error.value,
        "error_at_most": error.at_most,
    }


def sentence(found: dict[str, Any], because: str = "") -> str:
    """The verdict for a person; `because` is the reason why a quantity is compared, or none can be.

    Where the budget ended before all methods were tried (`budget_ended`), no method is recommended: another may be better.
    The price of a digit, along a front of few methods, and the runs for other times are left out then.
    """
    quantity = found["quantity"]
    if quantity is None:
        return f"nothing can be compared: {because}"
    if found.get("budget_ended"):
        return _of_few(found)
    parts = []
    if found["time_per_digit"] is not None:
        forces = found["evaluations_per_digit"]
        also = f" and {factor(forces)} the force evaluations" if forces is not None else ""
        parts.append(f"ten times less error costs {factor(found['time_per_digit'])} the time{also}")
    target = f"{found['target']:.0e}".replace("e-0", "e-")
    if choice := found.get("choice"):
        parts.append(
            f"for {target} of {quantity} take {_method(choice)} with {choice['setting']}, "
            f"{duration(choice['seconds'])}{_energy(choice)}"
        )
        parts.append(_other_times(found))
        parts.append(_other_precisions(found))
        parts.append(_other_backends(found))
        parts.append(_film(found))
    elif best := found.get("best"):
        parts.append(f"nothing that was tried reaches {target} of {quantity}; {best['integrator']} came to {_error(best)}")
    if own := found.get("own"):
        parts.append(_own(own, found))
    return "; ".join(part for part in parts if part) or "too little was measured to say what accuracy costs"


def _of_few(found: dict[str, Any]) -> str:
    """The verdict of a study whose budget ended before all methods were tried."""
    target = f"{found['target']:.0e}".replace("e-0", "e-")
    tried, suited = found["methods_tried"], found["methods_suited"]
    parts = [f"the budget ended when {tried} of {suited} methods had been tried"]
    if choice := found.get("choice"):
        first = f"of these, {_method(choice)} with {choice['setting']} reaches {target} of {found['quantity']} "
        parts.append(f"{first}in the shortest time, {duration(choice['seconds'])}; the others may be faster")
    elif best := found.get("best"):
        parts.append(f"none of these reaches {target} of {found['quantity']}; {best['integrator']} came to {_error(best)}")
    else:
        parts.append("too little was measured to compare them")
    if own := found.get("own"):
        parts.append(_own(own, found))
    parts.append("the same command goes on with the others; --budget gives it more time at once")
    return "; ".join(part for part in parts if part)


def _other_times(found: dict[str, Any]) -> str:
    """The smallest errors of runs that take a tenth, and ten times, the time of the chosen run."""
    said = []
    for name, words in (("faster", "a tenth of this time"), ("slower", "ten times this time")):
        if (other := found.get(name)) and other["key"] != found["choice"]["key"]:
            said.append(f"{words} buys {_error(other)} ({_method(other)}, {other['setting']})")
    return ", ".join(said)


def _other_precisions(found: dict[str, Any]) -> str:
    """The time that the target takes in every other precision that was tried, over the time of the choice."""
    said = []
    for other in sorted(found["precisions"], key=lambda each: float(each["seconds"])):
        relation = _relation(other["seconds"] / found["choice"]["seconds"])
        is_same = all(other[name] == found["choice"][name] for name in ("integrator", "setting"))
        how = "the same" if is_same else f"{other['integrator']} with {other['setting']}"
        said.append(f"in {other['precision']} {how} takes {duration(other['seconds'])} ({relation})")
    if missed := found["too_rounded"]:
        said.append(f"in {' and '.join(filter(None, (', '.join(missed[:-1]), missed[-1])))} nothing that was tried reaches it")
    return ", ".join(said)


def _other_backends(found: dict[str, Any]) -> str:
    """The time that the target takes on every other backend that was tried, over the time of the choice."""
    said, choice = [], found["choice"]
    for other in found["elsewhere"]:
        relation = _relation(other["seconds"] / choice["seconds"])
        is_same = all(other[name] == choice[name] for name in ("integrator", "setting"))
        where = f"{other['backend']} in {other['precision']} the same" if is_same else f"{other['backend']} it"
        how = "" if is_same else f", by {other['integrator']} in {other['precision']} with {other['setting']}"
        said.append(f"on {where} takes {duration(other['seconds'])} ({relation}){how}")
    for other in found["missed"]:
        how = f"{other['integrator']} in {other['precision']}, {other['setting']}"
        said.append(f"on {other['backend']} nothing that was tried reaches it: {how}, came to {_error(other)}")
    return ", ".join(said)


def _relation(ratio: float) -> str:
    """How a time is to another, by their ratio."""
    return f"{factor(ratio)} as long" if ratio >= 1.0 else f"{factor(1.0 / ratio)} faster"


def _method(described: dict[str, Any]) -> str:
    """`leapfrog in f64`, and the backend where it is not the CPU."""
    where = "" if described["backend"] == "cpu" else f" on {described['backend']}"
    return f"{described['integrator']} in {described['precision']}{where}"


def _film(found: dict[str, Any]) -> str:
    """The run that is exact enough for a film, and how much faster it is than the choice."""
    film, choice = found.get("film"), found["choice"]
    if film is None or film["key"] == choice["key"]:
        return ""
    gain = f", {factor(choice['seconds'] / film['seconds'])} faster" if film["seconds"] < choice["seconds"] / ALIKE else ""
    how = f"{_method(film)} with {film['setting']}"
    return f"for a film, in which the eye sees {FILM:.0e}, {how} is enough{gain}".replace("e-0", "e-", 1)


def _energy(described: dict[str, Any]) -> str:
    return "" if described["joules"] is None else f" and {described['joules']:.2g} J"


def _error(described: dict[str, Any]) -> str:
    return str(MeasuredError(described["error"], described["error_at_most"]))


def _own(own: dict[str, Any], found: dict[str, Any]) -> str:
    target = f"{found['target']:.0e}".replace("e-0", "e-")
    setting = f"this scene's own setting ({own['integrator']}, {own['setting']})"
    if own["status"] != "ok":
        return f"{setting} does not hold"
    if own["error"] is None and own["error_at_most"] is None:
        return ""
    error = f"{own['error']:.1e}" if own["error"] is not None else f"at most {rounded_up(own['error_at_most']):.0e}"
    if own["step_ratio"] is None:
        if (bound := own["error_at_most"]) is not None and bound > found["target"]:
            return f"{setting} has an error of {error}, more of which is not known"
        relation = f"misses {target}" if own["error"] is not None and own["error"] > found["target"] else f"reaches {target}"
        return f"{setting} {relation}: its error is {error}"
    ratio = own["step_ratio"]
    if ratio < 1.0:
        return f"{setting} has the error {error}: its step is {factor(1.0 / ratio)} coarser than {target} allows"
    return f"{setting} has the error {error}: its step is {factor(ratio)} finer than {target} needs"


def factor(value: float) -> str:
    """`25,000×`, `12×`, `1.4×`, or near and below one `1.03×`."""
    if value >= 1000.0:
        return f"{float(f'{value:.2g}'):,.0f}×"
    return f"{value:.0f}×" if value >= 10.0 else f"{value:.1f}×" if value >= 1.05 else f"{value:.2f}×"


def duration(seconds: float | None) -> str:
    """`0.8 s`, `1.2 ms`, `35 µs`."""
    if seconds is None:
        return "–"
    size, unit = next((each for each in ((1.0, "s"), (1e-3, "ms")) if seconds >= each[0]), (1e-6, "µs"))
    return f"{float(f'{seconds / size:.2g}'):g} {unit}"
