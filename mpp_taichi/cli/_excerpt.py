"""Excerpt: a part of a run from an archive, for a film of it; it begins at the last record before the part."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._goal import Goal
from mpp_taichi.simulation.moment import go_to

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


@dataclass(frozen=True, eq=False)
class Excerpt:
    """A part of a run, from one time to another; it stands in a request in the place of a `Rewind`.

    record   the last record before the part; None for the start of the run
    """

    file: Path
    record: Mapping[str, Any] | None
    begin: float
    end: float
    state: None = None  # with which the run begins: that of its scene
    goes_on: bool = False  # an excerpt keeps no archive

    def choose_step(self, simulation: "Simulation") -> str:
        """Take the simulation to the record, and return a line that says so; the step is that of the run.

        Raises:
            StateError: the record is of another run.
        """
        if self.record is not None:
            go_to(simulation, self.record["moment"])
        return f"{self.file}, computed again from t = {simulation.time:.9g}"

    def goal(self, goal: Goal, simulation: "Simulation") -> Goal:
        """The end of the part."""
        return Goal(self.end, None, False, self.begin)
