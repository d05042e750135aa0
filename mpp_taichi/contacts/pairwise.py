"""Overlapping pairs bounce after each step: the method of the MPPhys paper, as a baseline."""

from typing import Any

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactReport, ContactSetup, ContactSolver
from mpp_taichi.contacts.overlap.overlaps import Overlaps
from mpp_taichi.contacts.overlap.rounds import OverlapRounds
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu


@component
class Pairwise(ContactSolver):
    """Spheres move through the whole step; pairs that then overlap get the impulse of Eq. 9 and are pushed apart.

    See `overlap_bounces.py` for the equations.

    The method is approximate: times and places of contacts are wrong by up to a step, several contacts in a step come in the
    order of their numbers, and spheres that move farther than their size in a step tunnel. The report has the largest overlap.
    Two slips in the text of the paper are corrected: the spheres are pushed in opposite directions, and by inverse mass, so
    that their centre of mass stays.
    """

    restitution: float = param(
        1.0, minimum=0.0, maximum=1.0, help="e, relative speed after the contact over the speed before; 1: elastic"
    )
    contact_time: float = param(
        0.0, minimum=0.0, unit="time", help="t_c: a contact within this time after the last contact is elastic; 0: never"
    )

    drifts = True
    takes_motions = True
    takes_turnings = True
    takes_friction = True
    sees_flights = False
    order = 1

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        self.setup = setup.with_bounces(self.restitution, self.contact_time)
        self.overlaps = Overlaps(self.setup, state) if on_cpu() else OverlapRounds(self.setup, state)

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move all spheres by h [time] along their velocities; then let overlapping pairs bounce."""
        self.overlaps.drift(time, h)

    def sum_fields(self) -> tuple[Any, ...]:
        """Virial, energy and impulses on surfaces."""
        return self.overlaps.tally.sum_fields

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        return self.overlaps.collect()

    def destroy(self) -> None:
        """Give the memory back."""
        self.overlaps.destroy()
