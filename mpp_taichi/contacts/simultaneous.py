"""Time-stepped hard spheres: all contacts that touch at one instant are resolved together."""

from typing import Any

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactReport, ContactSetup, ContactSolver
from mpp_taichi.contacts.sweep.sweep import MOST_IN_ONE_THREAD, sweep_in_groups


@component
class Simultaneous(ContactSolver):
    """Straight flights from contact to contact within a drift; all spheres that touch at one instant are resolved as a group.

    Groups are resolved by generalized reflections (`reflections.py`): independent of numbering, symmetric in a
    symmetric scene, energy is kept where e = 1, and as many balls leave a row of touching balls as come in. Two spheres that
    touch no other sphere bounce as with `swept`, at the exact time of contact. Not for piles: a group of more than 512 contacts
    that approach together is given up, and for spheres that rest on each other under gravity `resting` is better.
    """

    restitution: float = param(
        1.0, minimum=0.0, maximum=1.0, help="e, relative speed after the contact over the speed before; 1: elastic"
    )
    contact_time: float = param(
        0.0, minimum=0.0, unit="time", help="t_c: a contact within this time after the last contact is elastic; 0: never"
    )
    event_limit: int = param(
        1_000_000, minimum=1, help="contacts of one connected group in a drift; a group with more is given up"
    )

    order = 2
    drifts = True
    most_elsewhere = MOST_IN_ONE_THREAD

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        self.setup = setup.with_bounces(self.restitution, self.contact_time)
        self.sweep = sweep_in_groups(self.setup, state, event_limit=self.event_limit)

    def prepare(self, time: float) -> None:
        """Take over the state that was set from outside, with the same bits as in a run that begins here."""
        self.sweep.forget()

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move all spheres by h [time] along their velocities, with the contacts on the way."""
        self.sweep.drift(time, h)

    def write_back(self) -> None:
        """Bring positions and velocities of the state up to date."""
        self.sweep.write_back()

    def sum_fields(self) -> tuple[Any, ...]:
        """Virial, energy and impulses on surfaces."""
        return self.sweep.parts.tally.sum_fields

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        return self.sweep.collect()

    def destroy(self) -> None:
        """Give the memory back."""
        self.sweep.destroy()
