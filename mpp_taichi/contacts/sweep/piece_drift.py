"""The drift of many spheres, piece by piece."""

from abc import ABC, abstractmethod

import taichi as ti

from mpp_taichi.contacts.sweep.drift_planning import Piece
from mpp_taichi.contacts.sweep.sweep_parts import SweepParts

TRIES = 64  # to do a piece with wider margins, then to do shorter pieces


class PieceSteps(ABC):
    """The steps of a piece, in which the CPU and a device of many threads differ (IslandPieces, DevicePieces)."""

    @abstractmethod
    def search(self, time: float, h: float) -> int:
        """Find the first contacts of all spheres; returns about how many there are."""

    @abstractmethod
    def play(self, time: float, h: float, *, is_first: bool) -> tuple[int, int]:
        """Form the islands that changed and play them; returns whether islands must be joined, and whether a margin failed."""

    @abstractmethod
    def retry(self, piece: Piece) -> Piece:
        """The piece that is tried after a margin failed."""

    @abstractmethod
    def commit(self, h: float) -> None:
        """Put all spheres where they are at the end of the piece."""

    @abstractmethod
    def destroy(self) -> None:
        """Give the memory back."""


@ti.data_oriented
class PieceDrift:
    """Plans a piece, searches it for contacts, and plays its islands until no two of them have to be joined.

    Where a sphere left the margin within which its partners were searched, the piece is done again.
    """

    def __init__(self, parts: SweepParts, steps: PieceSteps) -> None:
        """Bind the parts."""
        self.planner, self.candidates, self.slots = parts.planner, parts.candidates, parts.slots
        self.islands, self.tally, self.state, self.steps = parts.islands, parts.tally, parts.state, steps

    def destroy(self) -> None:
        """Give the memory back."""
        self.steps.destroy()

    def drift(self, time: float, h: float) -> None:
        """Move all spheres by h along their velocities, contacts resolved on the way."""
        done = 0.0
        while done < h:
            done += self._drift_piece(time + done, h - done)

    def _drift_piece(self, time: float, rest: float) -> float:
        """Do a piece of a drift of which `rest` is left; returns the length of the piece."""
        motion = self.slots.motion or self.planner.measure(self.state.position, self.state.velocity)
        piece = self.planner.plan(rest, motion)
        for _ in range(TRIES):
            self.candidates.find(piece)
            links = self.steps.search(time, piece.h)
            if links > self.islands.capacity or self.planner.is_crowded(piece, links):
                piece = self.planner.shorten(piece)
            elif self._play_until_nothing_joins(time, piece.h) == 0:
                break
            else:
                piece = self.steps.retry(piece)
        else:
            self._give_up()
        self.steps.commit(piece.h)
        return piece.h

    def _play_until_nothing_joins(self, time: float, h: float) -> int:
        """Play all islands; returns 0 unless a margin failed."""
        joins, violations = self.steps.play(time, h, is_first=True)
        while joins > 0 and violations == 0:
            joins, violations = self.steps.play(time, h, is_first=False)
        return violations

    @ti.kernel
    def _give_up(self):
        self.tally.give_up(0, ti.max(self.planner.violations[0], 1))
