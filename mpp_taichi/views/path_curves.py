"""Paths between two moments: cubics through positions and velocities, cut into as many straight pieces as they bend.

The cubic of Hermite through p₀, v₀ and p₁, v₁, the time h apart, differs from a smooth path by up to h⁴/384 of its fourth
derivative: from a circle by 2·10⁻⁴ of its radius where 30° are passed, by 5·10⁻² at 120°. A chord of a curve with the
acceleration a differs from it by a h²/8.

Where the velocity jumps within h, as in a collision, the cubic would leave the path. Then c = (p₁ − p₀)/h differs from the mean
of v₀ and v₁: of one bounce at the share s of the time |v₀ + v₁ − 2c| = |2s − 1| |v₁ − v₀|, while a smooth turn by the angle θ
has |v₀ + v₁ − 2c| ≈ θ/6 |v₁ − v₀|.
"""

from dataclasses import dataclass

import numpy as np

from mpp_taichi.arithmetic.hermite import cubic

MOST_PIECES = 64
JUMP = 0.3  # |v₀ + v₁ − 2c| over |v₁ − v₀|, from which on a scene with collisions has a jump there; a turn by 100° has it
SLIGHT = 0.01  # |v₀ + v₁ − 2c| over the larger speed, up to which no jump can be seen
LOST = 1.0  # |v₀ + v₁ − 2c| over the larger speed, from which on the cubic tells nothing about the path
CORNER = 0.05  # of h |v₁ − v₀|: two straight ways that pass each other as near as this meet at a corner


@dataclass(frozen=True, eq=False)
class Pieces:
    """Straight pieces of paths: ends (count, 2, 3), the entry that each belongs to (count,), and the shares of the time
    between the two moments at which it begins and ends, (count, 2).
    """

    ends: np.ndarray
    owner: np.ndarray
    share: np.ndarray


def path_pieces(
    begin: np.ndarray, end: np.ndarray, span: float, tolerance: float, *, collides: bool = False, chords: bool = False
) -> Pieces:
    """Pieces of the paths from `begin` to `end`, both (count, 6) with positions and velocities, a time `span` apart.

    No piece is farther from its curve than `tolerance` [length], as long as `MOST_PIECES` are enough. `collides` looks for
    jumps of velocities. `chords` joins the positions.
    """
    p0, p1, count = begin[:, :3], end[:, :3], len(begin)
    if chords or not span > 0.0:
        whole = np.broadcast_to(np.array([0.0, 1.0]), (count, 2))
        return Pieces(np.stack([p0, p1], axis=1), np.arange(count), whole)
    v0, v1 = span * begin[:, 3:], span * end[:, 3:]  # as ways
    with np.errstate(invalid="ignore", over="ignore"):
        way = p1 - p0
        bend0, bend1 = 6.0 * way - 4.0 * v0 - 2.0 * v1, 4.0 * v1 + 2.0 * v0 - 6.0 * way  # second derivatives at both ends
        smooth = _is_smooth(way, v0, v1, collides=collides)
        bend = np.where(smooth, np.sqrt(np.maximum((bend0**2).sum(axis=1), (bend1**2).sum(axis=1))), 0.0)
        wanted = np.ceil(np.sqrt(np.nan_to_num(bend, posinf=0.0) / (8.0 * tolerance)))
    pieces = np.clip(np.nan_to_num(wanted, posinf=MOST_PIECES), 1, MOST_PIECES).astype(np.int64)
    corner = None
    if collides and not smooth.all():
        corner, meets = _corners(p0, p1, v0, v1)
        meets &= ~smooth
        pieces[meets] = 2
    owner = np.repeat(np.arange(count), pieces)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = np.stack([number, number + 1.0], axis=1) / pieces[owner, None]
    curved = pieces[owner] > 1
    ends = np.empty((len(owner), 2, 3))
    ends[:, 0], ends[:, 1] = p0[owner], p1[owner]
    if curved.any():
        which = owner[curved]
        ends[curved] = _cubic(p0[which], p1[which], v0[which], v1[which], share[curved])
    if corner is not None:
        at, there = corner
        bent = meets[owner]
        first = bent & (number == 0)
        second = bent & (number == 1)
        ends[first, 0], ends[first, 1] = p0[owner[first]], there[owner[first]]
        ends[second, 0], ends[second, 1] = there[owner[second]], p1[owner[second]]
        share[first, 1] = share[second, 0] = at[owner[first]]
    return Pieces(ends, owner, share)


def cubic_points(begin: np.ndarray, end: np.ndarray, span: float, shares: np.ndarray) -> np.ndarray:
    """Points at shares of the time on the cubics from `begin` to `end`, (count, 6) each; shape (shares, count, 3)."""
    v0, v1 = span * begin[:, 3:], span * end[:, 3:]
    p0, p1 = begin[:, :3], end[:, :3]
    lost = ~_is_smooth(p1 - p0, v0, v1, collides=False)
    found = np.stack([_cubic(p0, p1, v0, v1, np.full((len(p0), 1), share))[:, 0] for share in shares])
    found[:, lost] = p0[lost] + shares[:, None, None] * (p1 - p0)[lost]
    return found


def _is_smooth(way: np.ndarray, v0: np.ndarray, v1: np.ndarray, *, collides: bool) -> np.ndarray:
    """Whether the cubic follows the path; all as ways within the same time."""
    apart = np.linalg.norm(v0 + v1 - 2.0 * way, axis=1)
    fastest = np.maximum(np.linalg.norm(v0, axis=1), np.linalg.norm(v1, axis=1))
    if not collides:
        return np.asarray(apart <= LOST * fastest)
    return np.asarray((apart <= JUMP * np.linalg.norm(v1 - v0, axis=1)) | (apart <= SLIGHT * fastest))


def _cubic(p0: np.ndarray, p1: np.ndarray, v0: np.ndarray, v1: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Points (count, n, 3) of cubics at shares (count, n) of the time; both ends are exact."""
    p0, p1, v0, v1 = (each[:, None, :] for each in (p0, p1, v0, v1))
    return cubic(share[:, :, None], 1.0, (p0, v0), (p1, v1))


def _corners(
    p0: np.ndarray, p1: np.ndarray, v0: np.ndarray, v1: np.ndarray
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Where the way straight on from p₀ meets the way straight back from p₁: shares of the time and places, and whether."""
    turn = v0 - v1
    with np.errstate(divide="ignore", invalid="ignore"):
        at = np.einsum("ij,ij->i", p1 - p0 - v1, turn) / np.einsum("ij,ij->i", turn, turn)
        one, other = p0 + at[:, None] * v0, p1 - (1.0 - at[:, None]) * v1
        near = np.linalg.norm(one - other, axis=1) <= CORNER * np.linalg.norm(turn, axis=1)
        return (at, 0.5 * (one + other)), near & (at > 0.0) & (at < 1.0)
