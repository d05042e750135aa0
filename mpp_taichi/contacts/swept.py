"""Time-stepped hard spheres with every contact at its exact time: nothing tunnels at any speed."""

from typing import Any

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactReport, ContactSetup, ContactSolver
from mpp_taichi.contacts.sweep.sweep import MOST_IN_ONE_THREAD, sweep_in_pairs, sweep_on_device
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu


@component
class Swept(ContactSolver):
    """Straight flights from contact to contact within a drift, two spheres at a time (`sweep.py`).

    Equal to an event-driven run between kicks, to round-off, whatever the step. Contacts that coincide are resolved one
    after the other, by time and then by number. Spheres at rest on each other under a steady force meet ever more often
    within a step: with e < 1 give them a `contact_time`, or a run ends at `event_limit`.
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
    takes_heat = True
    takes_motions = True
    takes_turnings = True
    takes_friction = True

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        self.setup = setup.with_bounces(self.restitution, self.contact_time)
        fits_one_thread = on_cpu() or setup.particle_count <= MOST_IN_ONE_THREAD
        kind = sweep_in_pairs if fits_one_thread else sweep_on_device
        self.sweep = kind(self.setup, state, event_limit=self.event_limit)

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
