"""What the solvers that sweep have in common: they differ in the rule for what happens at a contact."""

from typing import Any

from mpp_taichi.contacts._base import ContactReport, ContactSetup, ContactSolver
from mpp_taichi.contacts.sweep.island_play import MOST_IN_ONE_THREAD
from mpp_taichi.contacts.sweep.sweep import Sweep


class SweepSolver(ContactSolver):
    """A contact solver that drifts by a sweep of the kind `sweep_kind`; components declare `event_limit`."""

    drifts = True
    sweep_kind: type[Sweep] = Sweep
    event_limit: int
    most_elsewhere = MOST_IN_ONE_THREAD

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        self.setup = setup
        self.sweep = self.sweep_kind(setup, state, event_limit=self.event_limit)

    def prepare(self, time: float) -> None:
        """Positions were set from outside: what follows is to be as in a run that begins here, bit for bit."""
        self.sweep.forget()

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move all spheres by h [time] along their velocities, with the contacts on the way."""
        self.sweep.drift(time, h)

    def write_back(self) -> None:
        """Bring positions and velocities of the state up to date."""
        self.sweep.write_back()

    def collect(self) -> ContactReport:
        """What was counted since it was last asked."""
        return self.sweep.collect()

    def destroy(self) -> None:
        """Give the memory back."""
        self.sweep.destroy()
