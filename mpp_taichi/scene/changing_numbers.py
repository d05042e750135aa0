"""Changing numbers: the masses and charges of bodies that are given functions of the time, m(t) = m f(t) and q(t) = q g(t)."""

from dataclasses import dataclass, replace
from typing import Any

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


def changes_of(spec: SceneSpec, snapshot: Snapshot) -> list[Change]:
    """The changes of a scene, of which a snapshot has the indices of the bodies; SymPy is imported where there is one."""
    if not snapshot.changing:
        return []
    from mpp_taichi.scene.formulas.path_law import path_law

    numbers = dict.fromkeys(number for number, _entry, _quantity in spec.changing_entries)
    index = dict(zip(numbers, snapshot.changing, strict=True))
    return [
        Change(index[number], quantity, entry.parameters[quantity], path_law((entry.parameters[f"{quantity}_factor"],)))
        for number, entry, quantity in spec.changing_entries
    ]


def with_changes(spec: SceneSpec, snapshot: Snapshot) -> Snapshot:
    """The snapshot with the masses and charges of its time."""
    changes = changes_of(spec, snapshot)
    if not changes:
        return snapshot
    numbers: dict[str, Any] = {"mass": snapshot.mass.copy(), "charge": snapshot.charge.copy()}
    for change in changes:
        numbers[change.quantity][change.index] = change.at(snapshot.time)
    return replace(snapshot, **numbers)
