"""Synthetic samples, and the diagnostics of a key of `expect:`."""

from dataclasses import dataclass
from typing import Any

from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.report.expectations import diagnostic_of
from mpp_taichi.scene.spec import Expectation, Location
from mpp_taichi.snapshot import Snapshot


@dataclass
class MadeUpSample:
    """A sample of a run that there never was."""

    snapshot: Snapshot
    time: float = 0.0
    contact_report: ContactReport = ContactReport()
    potential_energy: float = 0.0
    phase_number: int = 0
    phase_energy: float | None = None
    gravity: float = 0.0


def measuring(name: str, **parameters: Any) -> Diagnostic:
    """The diagnostic of a key of `expect:`; parameters that are not given have their defaults."""
    return diagnostic_of(Expectation(name, parameters, None, None, None, None, Location("", 0, 0)))
