"""Spheres that meet become one, as planetesimals do."""

from typing import Any

import numpy as np

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactReport, ContactSetup, ContactSolver
from mpp_taichi.contacts.mergers.drift import MergingDrift

LOG_CAPACITY = 65_536  # events that are logged on the device before the host takes them


@component
class Merging(ContactSolver):
    """Two spheres that meet become one with the mass, the momentum, the charge and the volume of both (`merger.py`).

    Meetings are found at their exact time on the straight flights of a drift, whatever the speed, and resolved in the order of
    time; a merged sphere may meet other spheres within the same drift. The heavier sphere, or of equally heavy spheres the
    sphere with the lower number, goes on at the centre of mass; the other is gone. Off walls spheres bounce with the
    restitution of the wall. Momentum is kept; the angular momentum of the two about each other is lost, as spheres have no
    spin.
    """

    bounce_limit: int = param(1_000_000, minimum=1, help="bounces off walls in a drift; a drift with more is given up")

    drifts = True
    merges = True
    in_turn = "it takes one meeting after the other from a list"
    can_log = True

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Allocate for the spheres of `setup`, whose masses, radii and motion are fields of `state`."""
        self.setup = setup
        capacity = LOG_CAPACITY if self.logs else 0
        self.ways = MergingDrift(setup, state, self.forces, bounce_limit=self.bounce_limit, log_capacity=capacity)

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move all spheres by h [time] along their velocities; spheres that meet on the way merge."""
        self.ways.drift(time, h)

    def sum_fields(self) -> tuple[Any, ...]:
        """Virial, energies and impulses on surfaces."""
        return (*self.ways.tally.sum_fields, self.ways.merger.potential_change)

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        return self.ways.collect()

    def take_log(self) -> np.ndarray | None:
        """Mergers and bounces since the last call: time, sphere that goes on, lost sphere (−1 − w: surface w), momentum."""
        return self.ways.log.take() if self.logs else None

    def destroy(self) -> None:
        """Give the memory back."""
        self.ways.destroy()

    def failure(self, count: int) -> str:
        """The message for a sphere that bounced too often, or for too many spheres that met at one time."""
        return f"{count} drifts with more contacts than there is room for; try a smaller dt"

    @property
    def conserves_energy(self) -> bool:
        """False: a merger takes the kinetic energy of the relative motion."""
        return False

    @property
    def gains_no_energy(self) -> bool:
        """False: a merger removes the potential energy of the two spheres, which may be negative."""
        return False
