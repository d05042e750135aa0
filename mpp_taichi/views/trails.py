"""Trails: the last part of the path of every particle, drawn as lines that fade."""

from bisect import bisect_left
from itertools import pairwise
from typing import Protocol

import numpy as np

from mpp_taichi.views._base import Frame
from mpp_taichi.views.path_curves import Pieces, cubic_points, path_pieces

COARSER = 2.0  # factor between the tolerances for which curves are cut anew, as where the camera zooms


class DrawnTrails(Protocol):
    """The function of trails that a renderer uses."""

    def segments(
        self, color: np.ndarray, background: np.ndarray, tolerance: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ends of segments, colours of the ends, and ages, as of `Trails`."""


class Trails:
    """The paths of every particle through the last frames, as line segments that fade into the background.

    `length` is a number of frames. Between two frames a path is a cubic through the positions and velocities of both, or
    several through the samples that the frame brings along. A frame at the same time as the last frame (a paused simulation)
    adds no position. A frame at an earlier time removes the positions after that time. A frame with another number of
    particles begins new trails.
    """

    MADE_ANEW = ("_pieces", "_tolerance")  # for `archive.object_state`: they follow from the rest

    def __init__(self, length: int) -> None:
        """Begin without positions."""
        self.length = length
        self._positions: list[np.ndarray] = []
        self._times: list[float] = []
        self._velocities: list[np.ndarray | None] = []
        self._between: list[tuple[np.ndarray, ...]] = []  # index, time, and places and velocities of samples before a frame
        self._collides = False
        self._period = np.zeros(3)
        self._pieces: list[Pieces | None] = []  # from each frame to the next
        self._tolerance = 0.0

    def clear(self) -> None:
        """Forget every position."""
        self._cut(0)

    def add(self, frame: Frame) -> None:
        """Add the positions of a frame."""
        if self.length < 1 or (self._times and frame.time == self._times[-1]):
            return
        if self._positions and len(self._positions[-1]) != len(frame.position):
            self.clear()
        self._complete()
        self._cut(bisect_left(self._times, frame.time))
        self._collides, self._period = frame.collides, np.array(frame.period)
        self._times.append(frame.time)
        self._positions.append(np.array(frame.position, dtype=float))
        samples = (frame.path_index, frame.path_time, frame.path)
        self._between.append(() if any(each is None for each in samples) else tuple(np.array(each) for each in samples))
        self._velocities.append(self._velocity(frame))
        if len(self._times) > 1:
            self._pieces.append(None)
        for each in (self._times, self._positions, self._velocities, self._between):
            del each[: -(self.length + 1)]
        del self._pieces[: -self.length]

    def segments(
        self, color: np.ndarray, background: np.ndarray, tolerance: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Segments from oldest to newest: ends (count, 2, 3) and colours of both ends (count, 2, 3), then the ages.

        The segments are nowhere farther from the curves than `tolerance` [length]. The age of a segment, shape (count,), is
        that of its newer end: 0 for the newest, and it grows to 1 for the oldest.
        """
        steps = len(self._positions) - 1
        if steps < 1 or self.length < 1:
            return np.zeros((0, 2, 3)), np.zeros((0, 2, 3)), np.zeros(0)
        self._complete()
        if not self._tolerance / COARSER <= tolerance <= self._tolerance:
            self._tolerance, self._pieces = tolerance, [None] * steps
        parts = [self._pieces_of(number) for number in range(steps)]
        owner = np.concatenate([part.owner for part in parts])
        before = np.repeat(np.arange(steps), [len(part.owner) for part in parts])
        left = steps - before[:, None] - np.concatenate([part.share for part in parts])  # frames since then
        brightness = (1.0 - left / self.length)[:, :, None]
        colors = background + brightness * (np.asarray(color, dtype=float)[owner, None] - background)
        return np.concatenate([part.ends for part in parts]), colors, left[:, 1] / self.length

    def newest_points(self, index: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Places of some particles at shares of the time between the last two frames, (shares, index, 3)."""
        begin, end = (self._knots(number)[index] for number in (-2, -1))
        first, last = self._times[-2:]
        found = cubic_points(begin, end, last - first, shares)
        if not self._between[-1]:
            return found
        sampled, times, places = self._between[-1]
        _, of_sampled, of_index = np.intersect1d(sampled, index, return_indices=True)
        moments = [begin[of_index], *places[:, of_sampled], end[of_index]]
        ends = (np.array([first, *times, last]) - first) / (last - first)
        for n, (since, until) in enumerate(pairwise(ends)):
            here = (shares > since) & (shares <= until)
            if here.any():
                inside = (shares[here] - since) / (until - since)
                span = (until - since) * (last - first)
                found[np.ix_(here, of_index)] = cubic_points(moments[n], moments[n + 1], span, inside)
        return found

    def _velocity(self, frame: Frame) -> np.ndarray | None:
        """The velocities at the time of a frame whose velocities are a little older: v + δ Δv/Δt, with the last change."""
        if frame.velocity is None:
            return None
        velocity = np.array(frame.velocity, dtype=float)
        before = self._velocities[-1] if self._velocities else None
        if not frame.ahead or self._collides or before is None:
            return velocity
        change, since = velocity - before, np.full(len(velocity), frame.time - frame.ahead - self._times[-2])
        if self._between[-1]:
            index, times, places = self._between[-1]
            change[index], since[index] = velocity[index] - places[-1, :, 3:], frame.time - frame.ahead - times[-1]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return velocity + np.where(since > frame.ahead, frame.ahead / since, 0.0)[:, None] * change

    def _cut(self, kept: int) -> None:
        for each in (self._times, self._positions, self._velocities, self._between):
            del each[kept:]
        del self._pieces[max(0, kept - 1) :]

    def _complete(self) -> None:
        """Fill up what an archive of an earlier version does not hold."""
        self._velocities += [None] * (len(self._times) - len(self._velocities))
        self._between += [()] * (len(self._times) - len(self._between))
        self._pieces += [None] * (max(0, len(self._times) - 1) - len(self._pieces))

    def _pieces_of(self, number: int) -> Pieces:
        """The pieces from a frame to the next."""
        found = self._pieces[number]
        if found is None:
            found = self._pieces[number] = self._cut_up(number)
        return found

    def _cut_up(self, number: int) -> Pieces:
        knots = [self._knots(number), self._knots(number + 1)]
        first, last = self._times[number], self._times[number + 1]
        chords = any(self._velocities[n] is None for n in (number, number + 1))
        samples = self._between[number + 1]
        count = len(self._positions[number])
        finer = np.zeros(count, dtype=bool)
        parts = []
        if samples:
            index, times, places = samples
            finer[index] = True
            moments = [knots[0][index], *places, knots[1][index]]
            for n, (since, until) in enumerate(zip([first, *times], [*times, last], strict=True)):
                part = self._parts(moments[n], moments[n + 1], until - since, chords=chords)
                share = (since - first + (until - since) * part.share) / (last - first)
                parts.append(Pieces(part.ends, index[part.owner], share))
        rest = np.flatnonzero(~finer)
        part = self._parts(knots[0][rest], knots[1][rest], last - first, chords=chords)
        parts.append(Pieces(part.ends, rest[part.owner], part.share))
        return Pieces(*(np.concatenate([getattr(each, key) for each in parts]) for key in ("ends", "owner", "share")))

    def _knots(self, number: int) -> np.ndarray:
        """Positions and velocities of a frame, (count, 6)."""
        velocity = self._velocities[number]
        position = self._positions[number]
        return np.concatenate([position, np.zeros_like(position) if velocity is None else velocity], axis=1)

    def _parts(self, begin: np.ndarray, end: np.ndarray, span: float, *, chords: bool) -> Pieces:
        """Pieces of a path, but none across a box that repeats."""
        chords = chords or not np.isfinite(self._tolerance)
        part = path_pieces(begin, end, span, self._tolerance, collides=self._collides, chords=chords)
        if not self._period.any():
            return part
        with np.errstate(invalid="ignore"):
            jump = 2.0 * np.abs(end[:, :3] - begin[:, :3]) > np.where(self._period > 0.0, self._period, np.inf)
        kept = ~jump.any(axis=1)[part.owner]
        return Pieces(part.ends[kept], part.owner[kept], part.share[kept])
