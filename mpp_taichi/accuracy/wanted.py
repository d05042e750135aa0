"""Wanted: the quantity of `expect:` whose error a study compares in place of the error of positions."""

from dataclasses import dataclass
from typing import Any

from mpp_taichi import component
from mpp_taichi.quantities._base import Setting
from mpp_taichi.report.expectations import label_of
from mpp_taichi.scene.expectations import SUMMARY_QUANTITIES, kind_of
from mpp_taichi.scene.spec import Expectation, SceneSpec
from mpp_taichi.scene.wanted import GIVEN, wanted_entries

SAMPLES = 1024  # in a run of a method that needs no step, at least
ERRORS = ("_error", "_error_max")  # ends of the names of quantities that are errors themselves
STUDYS_OWN = ("position", "energy")  # names of the quantities that a study has without `expect:`


@dataclass(frozen=True, eq=False)
class Wanted:
    """A quantity of `expect:`, with each of its entries.

    runs      of every setting, from starts that differ by rounding: more than one where the values scatter
    shift     by which the starts differ in place of rounding, where every step gives another heap; see measuring.shifted_start
    samples   moments in a run of a method that needs no step, between which the quantity may be measured
    """

    name: str
    entries: tuple[Expectation, ...]
    runs: int = 1
    shift: float = 0.0
    samples: int = SAMPLES

    @staticmethod
    def of(spec: SceneSpec, name: str) -> "Wanted":
        """The quantity of this name; ValueError where the scene does not have it."""
        return Wanted(name, wanted_entries(spec, name))

    @property
    def column(self) -> str:
        """The name by which tables and choices tell the quantity from positions and energies of the study."""
        return f"{self.name} of expect" if self.name in STUDYS_OWN else self.name

    def labels(self, setting: Setting) -> list[str]:
        """`orbital_period(of=earth, around=sun)` for each entry."""
        return [label_of(entry, setting) for entry in self.entries]

    def identity(self) -> list[Any]:
        """The quantity and the parameters of its entries, as plain data."""
        return [[entry.quantity, entry.parameters] for entry in self.entries]

    def is_absolute(self, number: int) -> bool:
        """Whether an entry is an error itself, so that its own error is not divided by its value."""
        return self.entries[number].quantity.endswith(ERRORS)

    def is_pure_number(self, number: int) -> bool:
        """Whether an entry has no unit, as far as its declaration says."""
        name = self.entries[number].quantity
        if kind_of(name) == "quantities":
            return component.flag("quantities", name, "dimension") == (0, 0, 0)
        return name in SUMMARY_QUANTITIES and self.is_absolute(number)


def first_expected(spec: SceneSpec) -> str | None:
    """The name of the first entry of `expect:` that a method may change and that is no error itself; None without one."""
    names = [each.quantity for each in spec.expect if each.quantity not in GIVEN]
    return next((name for name in names if not name.endswith(ERRORS)), None)
