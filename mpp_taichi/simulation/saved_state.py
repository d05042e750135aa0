"""Saved states: moments of a run that it can go back to, bit for bit.

Each part of a run that changes as it goes on (the fields of a phase, the clock, the accounts) has `save()`, which copies all
that it knows, hidden memory too, and `restore(saved)`. A moment of the run consists of the saved data of its parts.
"""

from dataclasses import dataclass

from mpp_taichi.simulation.accounts import SavedAccounts
from mpp_taichi.simulation.clock import Reading
from mpp_taichi.simulation.compiled_phase import CompiledPhase, SavedFields
from mpp_taichi.simulation.course import Course


@dataclass(frozen=True, eq=False)
class Mark:
    """The particles at a time within a phase; no accounts."""

    fields: SavedFields
    clock: Reading

    @property
    def step(self) -> int:
        """Steps taken since the start of the run."""
        return self.clock.step_count


@dataclass(frozen=True, eq=False)
class Bookmark:
    """A moment of a run: the particles and the time, the phase with its course, and the accounts."""

    mark: Mark
    course: Course
    compiled: CompiledPhase
    number: int
    accounts: SavedAccounts

    @property
    def bytes(self) -> int:
        """Memory of the host that it takes, roughly."""
        return sum(each.nbytes for each in self.mark.fields.arrays)
