"""The parts that every sweep is made of."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.shared.bounce import Bounce
from mpp_taichi.contacts.shared.contact_counts import Tally
from mpp_taichi.contacts.shared.loop_watch import LoopWatch
from mpp_taichi.contacts.sweep.candidates import Candidates
from mpp_taichi.contacts.sweep.contact_memory import ContactMemory
from mpp_taichi.contacts.sweep.drift_planning import DriftPlanner
from mpp_taichi.contacts.sweep.islands import Islands
from mpp_taichi.contacts.sweep.played_spheres import PlayedSpheres
from mpp_taichi.contacts.sweep.slots import Slots
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.device_grid import DeviceGrid
from mpp_taichi.neighbors.point_grid import PointGrid


class SweepParts:
    """The spheres of a setup and the tables of their contacts; the kinds of sweeps differ in how they use them.

    bounce       formulas of a contact
    tally        counts of contacts
    slots        the spheres at the start of a piece
    played       the spheres of an island while it is played
    memory       times of the last contacts
    islands      which spheres are played together, and in which order their events come
    planner      pieces of a drift, and margins
    candidates   pairs that may touch in a piece; None where all pairs are tested
    watch        whether a device ended the loops of a thread
    """

    def __init__(self, setup: ContactSetup, state: Any, *, all_pairs: bool, lists: bool = False, stay: bool = False) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`.

        all_pairs   all pairs are tested, without a cell grid
        lists       the pairs that the grid shows may be listed
        stay        spheres may stay in their slots after a drift
        """
        n = setup.particle_count
        self.state = state
        self.bounce = Bounce(setup)  # filled before any field is left to be placed
        walls, wide = self.bounce.walls, getattr(state, "wide", ti.f64)
        self.tally = Tally(n, walls.account_count, wide, placed_by_caller=True, works=walls.works)
        may_meet = bool(setup.radius.any())
        self.grid: Any = None if all_pairs else _grid(setup) if may_meet else PointGrid(n, setup.dimensions)
        order = None if all_pairs else self.grid.order
        self.slots = Slots(setup, state, self.bounce, order, stay=stay and setup.force_free and not all_pairs)
        self.played = PlayedSpheres(setup, self.slots)
        beside = (*self.played.numbers, self.tally.summed)
        self.islands = Islands(n, beside, (*self.played.integers, self.tally.counted), order)
        self.planner = DriftPlanner(setup, state)
        self.memory = ContactMemory(setup)
        self.candidates: Any = None
        if not all_pairs:
            self.candidates = Candidates(self.slots, self.played, self.planner, self.grid, lists=lists and may_meet)
        self.watch = LoopWatch()
        self.memory.clear()

    def destroy(self) -> None:
        """Give the memory back."""
        parts = (self.bounce, self.slots, self.played, self.islands, self.tally, self.planner, self.memory, self.watch)
        for part in (*parts, self.candidates, self.grid):
            if part is not None:
                part.destroy()


def _grid(setup: ContactSetup) -> Any:
    kind, enclosure = CellGrid if on_cpu() else DeviceGrid, setup.enclosure
    return kind(setup.particle_count, setup.dimensions, enclosure.period, enclosure.origin)
