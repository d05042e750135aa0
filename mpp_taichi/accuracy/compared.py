"""Compared: the quantity whose errors a study compares, and why it is this quantity or why there is none."""

from dataclasses import dataclass

from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.reference_search import ReferenceSearch
from mpp_taichi.accuracy.value_search import ValueSearch


@dataclass(frozen=True)
class Compared:
    """The searches of a study, and what they mean for the quantity that is compared.

    asked     the quantity that was asked for, None for a choice by the scene
    has_aim   whether only one error is of interest
    """

    problem: Problem
    search: ReferenceSearch
    values: ValueSearch | None
    asked: str | None
    has_aim: bool
    conserves_energy: bool

    @property
    def quantity(self) -> str | None:
        """See Study.quantity."""
        if self.values is not None and self.problem.wanted is not None:
            return self.problem.wanted.column if self.values.desk.is_known else None
        asked = self.asked
        if asked != "energy" and self.search.reference is not None and self.search.reference.positions_mean_something:
            return "position"
        may = asked is None and not (self.problem.has_contacts and self.has_aim)
        by_energy = asked == "energy" or (may and self.search.horizon is not None)
        return "energy" if by_energy and self.conserves_energy else None

    @property
    def reason(self) -> str:
        """See Study.reason."""
        if self.values is not None:
            return _reason_of_values(self.values)
        asked, horizon, reference = self.asked, self.search.horizon, self.search.reference
        kept = "" if self.conserves_energy else ", and the scene does not keep its energy"
        if asked == "energy":
            return "energies were asked for" if kept == "" else "the scene does not keep its energy"
        if reference is None:
            return "the budget ended before the first run was done"
        if reference.positions_mean_something:
            return "positions at the end are known" if asked is None else "positions were asked for"
        if horizon is not None and self.problem.has_contacts:
            because = "since every collision enlarges the errors of rounding"
            return f"positions mean nothing beyond t = {horizon:.4g}, before the end, {because}{kept if asked is None else ''}"
        if horizon is not None:
            return f"positions mean nothing beyond t = {horizon:.4g}, before the end{kept if asked is None else ''}"
        return f"the budget ended before the reference was known ({reference.told}); a longer budget goes on"


def _reason_of_values(values: ValueSearch) -> str:
    if values.desk.is_known:
        return f"{values.desk.wanted.name} was asked for"
    if values.desk.reason:
        return f"{values.desk.wanted.name} is not known: {values.desk.reason}"
    known = "" if values.desk.reference is None else f" ({values.desk.reference.told})"
    return f"the budget ended before the value of {values.desk.wanted.name} was known{known}; a longer budget goes on"
