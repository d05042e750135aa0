"""Columns of numbers along a run as bytes that compress well: a grid for each entry, differences in time, planes of bytes.

x[k, i] ≈ origin[i] + step[i] · code[k, i] with code = 0 … 2^b − 2, and 2^b − 1 for NaN; b = 8 · byte_count and
step[i] = (max x − min x) / (2^b − 2) over the frames k, so that no number is off by more than step/2 and the rounding of
float64. Codes are differenced `order` times along k, modulo 2^b, as often as makes the differences smallest, which of a smooth
motion are small. Signs go into the lowest bit. The lowest bytes of all differences come first, then the next bytes, which are
long runs of zeros.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

MOST_DIFFERENCES = 3  # each doubles the rounding to the grid, which after more differences exceeds the motion


@dataclass(frozen=True, eq=False)
class EncodedColumn:
    """One encoded column; `planes` is empty, and byte_count 0, where every entry is the same in all frames."""

    name: str
    origin: np.ndarray
    step: np.ndarray
    byte_count: int
    order: int
    planes: bytes

    def description(self) -> dict[str, object]:
        """The numbers that a reader needs beside the bytes."""
        return {"name": self.name, "entries": len(self.origin), "bytes": self.byte_count, "order": self.order}

    def packed(self) -> bytes:
        """Origins and steps as little-endian float64, then the planes."""
        return self.origin.astype("<f8").tobytes() + self.step.astype("<f8").tobytes() + self.planes


def grid_step(values: np.ndarray, byte_count: int) -> np.ndarray:
    """The step of each entry's grid, shape (entries,), for values of shape (frames, entries)."""
    low, high = _range(values)
    return (high - low) / _last_code(byte_count)


def encode(name: str, values: np.ndarray, byte_count: int) -> EncodedColumn:
    """A column of the values, shape (frames, entries), in one to three bytes for each."""
    low, high = _range(values)
    seen = np.isfinite(values)
    if bool(seen.all()) and np.array_equal(low, high):
        return EncodedColumn(name, low, np.zeros_like(low), 0, 0, b"")
    last = _last_code(byte_count)
    step = (high - low) / last
    share = (np.where(seen, values, low) - low) / np.where(step > 0.0, step, 1.0)
    code = np.where(seen, np.minimum(np.rint(share), last), last + 1).astype(np.int32)
    order, residual = _smallest(code, 8 * byte_count)
    folded = np.ascontiguousarray(np.where(residual < 0, -2 * residual - 1, 2 * residual), dtype="<u4")
    parts = folded.view(np.uint8).reshape(-1, 4)
    return EncodedColumn(name, low, step, byte_count, order, b"".join(parts[:, plane].tobytes() for plane in range(byte_count)))


def stacked(frames: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays of one shape as (frames, entries); a single row where all are alike."""
    if all(np.array_equal(frame, frames[0]) for frame in frames[1:]):
        frames = frames[:1]
    return np.stack([np.asarray(frame, dtype=float).reshape(-1) for frame in frames])


def _last_code(byte_count: int) -> int:
    return int(2 ** (8 * byte_count) - 2)


def _range(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest number of each entry; 0 for an entry that is always NaN."""
    seen = np.isfinite(values)
    some = seen.any(axis=0)
    low = np.where(some, np.where(seen, values, np.inf).min(axis=0), 0.0)
    return low, np.where(some, np.where(seen, values, -np.inf).max(axis=0), 0.0)


def _smallest(code: np.ndarray, bits: int) -> tuple[int, np.ndarray]:
    """The number of differencings that takes the fewest bits, and the differences, in −2^(b−1) … 2^(b−1) − 1."""
    best_cost, best_order, best = np.inf, 0, code
    for order in range(MOST_DIFFERENCES + 1):
        if order:
            code = np.concatenate([code[:1], np.diff(code, axis=0)])
        code = (code + 2 ** (bits - 1)) % 2**bits - 2 ** (bits - 1)
        cost = float(np.log2(1.0 + 2.0 * np.abs(code)).sum())
        if cost < best_cost:
            best_cost, best_order, best = cost, order, code
    return best_order, best
