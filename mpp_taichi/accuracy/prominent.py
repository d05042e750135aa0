"""The methods that the plots of a study show in colour: the front, the scene's own setting, and methods that readers know."""

from collections.abc import Sequence
from typing import Any

from mpp_taichi import component
from mpp_taichi.accuracy.force_solvers import split
from mpp_taichi.accuracy.front import StudyRow
from mpp_taichi.accuracy.method_variants import split_variant

Key = tuple[str, str, str]  # integrator, precision, backend
FLAG = "well_known"


def groups(rows: Sequence[StudyRow]) -> dict[Key, list[StudyRow]]:
    """The rows that were run to the end, by method, precision and backend."""
    found: dict[Key, list[StudyRow]] = {}
    for row in rows:
        configuration = row.sample.configuration
        if row.sample.status == "ok":
            found.setdefault((configuration.integrator, configuration.precision, configuration.backend), []).append(row)
    return found


def prominent(rows: Sequence[StudyRow], verdict: dict[str, Any], quantity: str) -> list[Key]:
    """The groups to show in colour, each integrator's together, by falling error of its best row.

    They are the groups with a row on one of the fronts, the scene's own, of each order the first method with the flag
    `well_known`, and the method with the smallest error.
    """
    found = groups(rows)
    fronts = {*verdict.get("time_front", ()), *verdict.get("evaluations_front", ())}
    shown = [key for key, group in found.items() if any(row.is_own or row.sample.configuration.key in fronts for row in group)]
    for names in _known_by_order():
        candidates = [key for name in names for key in found if base_name(key[0]) == name and not _same(key, shown)]
        if candidates and not any(base_name(key[0]) in names for key in shown):
            shown.append(candidates[0])
    best = min(found, key=lambda key: _least(found[key], quantity), default=None)
    if best is not None and not _same(best, shown):
        shown.append(best)
    least = {name: min(_least(found[key], quantity) for key in shown if key[0] == name) for name, _, _ in shown}
    return sorted(shown, key=lambda key: (-least[key[0]], key[0]))


def base_name(method: str) -> str:
    """The integrator of a method of a study, without its tree and its variant."""
    try:
        return split_variant(split(method)[0])[0]
    except ValueError:
        return method


def _known_by_order() -> list[list[str]]:
    """The integrators that readers know, for each order."""
    by_order: dict[int, list[str]] = {}
    for name in component.marked("integrators", FLAG):
        by_order.setdefault(component.flag("integrators", name, "order", 0), []).append(name)
    return [by_order[order] for order in sorted(by_order)]


def _same(key: Key, shown: Sequence[Key]) -> bool:
    return any(key[0] == other[0] for other in shown)


def _least(group: Sequence[StudyRow], quantity: str) -> float:
    return min(row.error(quantity).bound for row in group)
