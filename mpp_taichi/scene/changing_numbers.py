"""Changing numbers: the masses and charges of bodies that are given functions of the time, m(t) = m f(t) and q(t) = q g(t)."""

from dataclasses import dataclass, replace
from typing import Any

from mpp_taichi.scene.layout import layout_of
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot


@dataclass(frozen=True)
class Change:
    """One number of a body: its index, "mass" or "charge", the number that is multiplied, and the factor as a function of t."""

    index: int
    quantity: str
    number: float
    law: Any  # PathLaw

    def at(self, time: float) -> float:
        """The number at a time."""
        return self.number * float(self.law.at(time)[0][0])


def changes_of(spec: SceneSpec) -> list[Change]:
    """The changes of a scene; SymPy is imported where there is one."""
    if not spec.changing_entries:
        return []
    from mpp_taichi.scene.formulas.path_law import path_law

    starts = layout_of(spec).starts
    return [
        Change(starts[number], quantity, entry.parameters[quantity], path_law((entry.parameters[f"{quantity}_factor"],)))
        for number, entry, quantity in spec.changing_entries
    ]


def with_changes(spec: SceneSpec, snapshot: Snapshot) -> Snapshot:
    """The snapshot with the masses and charges of its time."""
    if not spec.changing_entries:
        return snapshot
    numbers: dict[str, Any] = {"mass": snapshot.mass.copy(), "charge": snapshot.charge.copy()}
    for change in changes_of(spec):
        numbers[change.quantity][change.index] = change.at(snapshot.time)
    return replace(snapshot, **numbers)
