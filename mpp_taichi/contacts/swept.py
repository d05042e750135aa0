"""Time-stepped hard spheres with every contact at its exact time: nothing tunnels at any speed."""

from typing import Any

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.sweep.device_sweep import DeviceSweep
from mpp_taichi.contacts.sweep.island_play import MOST_IN_ONE_THREAD
from mpp_taichi.contacts.sweep.solver import SweepSolver
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu


@component
class Swept(SweepSolver):
    """Straight flights from contact to contact within a drift, two spheres at a time (`sweep.py`).

    Equal to an event-driven run between kicks, to round-off, whatever the step. Contacts that coincide are resolved one
    after the other, by time and then by number. Spheres at rest on each other under a steady force meet ever more often
    within a step: with e < 1 give them a `contact_time`, or a run ends at `event_limit`.
    """

    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="e, relative speed after over before; 1: elastic")
    contact_time: float = param(
        0.0, minimum=0.0, unit="time", help="t_c: contacts within it after the last are elastic; 0: off"
    )
    event_limit: int = param(
        1_000_000, minimum=1, help="contacts of one connected group in a drift, beyond which it is given up"
    )

    most_elsewhere = None
    order = 2

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        if on_cpu() or setup.particle_count <= MOST_IN_ONE_THREAD:
            SweepSolver.bind(self, setup, state)
        else:
            self.setup = setup
            self.sweep = DeviceSweep(setup, state, event_limit=self.event_limit)
