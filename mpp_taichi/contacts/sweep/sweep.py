"""Drift with exact contacts: straight flights, and every contact on the way at its time and in its order.

Spheres whose predicted contacts lie within the drift form islands; an island is played through event by event, and
islands in parallel. Where a sphere leaves a contact towards a sphere outside, the two islands are joined and played
again from the start of the drift, until no islands join: the result equals, to round-off, the result of one queue of all
events. Few spheres are one island from the beginning. Nothing depends on the number of threads.
"""

from typing import Any

from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.contacts.sweep.all_pairs_drift import AllPairsDrift
from mpp_taichi.contacts.sweep.device_islands import DeviceIslands
from mpp_taichi.contacts.sweep.device_pieces import DevicePieces
from mpp_taichi.contacts.sweep.group_rule import GroupRule
from mpp_taichi.contacts.sweep.island_pieces import IslandPieces
from mpp_taichi.contacts.sweep.island_player import IslandPlayer
from mpp_taichi.contacts.sweep.pair_rule import PairRule
from mpp_taichi.contacts.sweep.piece_drift import PieceDrift
from mpp_taichi.contacts.sweep.sweep_parts import SweepParts
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu

ALL_PAIRS_UP_TO = 300  # spheres; more are faster on the cell grid, see tools/benchmarks/benchmark_contacts.py
# The same for one thread of another device than the CPU: all pairs of so many spheres are a fifth of the iterations that
# software Vulkan allows a thread.
MOST_IN_ONE_THREAD = 160


class ContactSweep:
    """The spheres of a state, moved along their velocities from contact to contact.

    parts   the spheres and the tables of their contacts
    rule    how an event changes velocities: PairRule or GroupRule
    mover   how a drift is done: AllPairsDrift or PieceDrift
    """

    def __init__(self, parts: SweepParts, rule: PairRule | GroupRule, mover: AllPairsDrift | PieceDrift) -> None:
        """Bind the parts."""
        self.parts, self.rule, self.mover = parts, rule, mover

    def drift(self, time: float, h: float) -> None:
        """Move all spheres by h along their velocities, contacts resolved on the way."""
        with quick_compilation():  # a third of the time, for a kernel as fast
            self.mover.drift(time, h)

    def forget(self) -> None:
        """Note that the state was changed from outside: slots and listed pairs no longer hold."""
        self.parts.slots.forget()
        if self.parts.candidates is not None:
            self.parts.candidates.forget()

    def write_back(self) -> None:
        """Bring positions and velocities of the state up to date."""
        self.parts.slots.write_back()

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        return self.parts.tally.collect()

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.mover, self.rule, self.parts):
            part.destroy()


def sweep_in_pairs(setup: ContactSetup, state: Any, *, event_limit: int, all_pairs: bool | None = None) -> ContactSweep:
    """A sweep that resolves contacts one after the other; `all_pairs` when absent: for few spheres."""
    all_pairs = _are_few(setup) if all_pairs is None else all_pairs
    parts = SweepParts(setup, state, all_pairs=all_pairs, lists=True, stay=True)
    return _sweep(parts, PairRule(parts), event_limit)


def sweep_in_groups(setup: ContactSetup, state: Any, *, event_limit: int, all_pairs: bool | None = None) -> ContactSweep:
    """A sweep that resolves together all contacts of one instant; its islands are played one after the other."""
    all_pairs = _are_few(setup) if all_pairs is None else all_pairs
    parts = SweepParts(setup, state, all_pairs=all_pairs)
    return _sweep(parts, GroupRule(setup, parts), event_limit)


def sweep_on_device(setup: ContactSetup, state: Any, *, event_limit: int) -> ContactSweep:
    """A sweep of many spheres on a device of many threads; contacts are resolved one after the other."""
    parts = SweepParts(setup, state, all_pairs=False)
    rule, islands = PairRule(parts), DeviceIslands(parts.islands)
    player = IslandPlayer(parts, rule, islands, event_limit)
    return ContactSweep(parts, rule, PieceDrift(parts, DevicePieces(parts, player, islands)))


def _sweep(parts: SweepParts, rule: PairRule | GroupRule, event_limit: int) -> ContactSweep:
    player = IslandPlayer(parts, rule, parts.islands, event_limit)
    if parts.slots.all_pairs:
        return ContactSweep(parts, rule, AllPairsDrift(parts, player))
    return ContactSweep(parts, rule, PieceDrift(parts, IslandPieces(parts, player, in_turn=rule.in_turn)))


def _are_few(setup: ContactSetup) -> bool:
    return setup.particle_count <= (ALL_PAIRS_UP_TO if on_cpu() else MOST_IN_ONE_THREAD)
