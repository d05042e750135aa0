"""Moving frame: a uniformly moving frame in which positions stay small, wherever the origin is and however the system moves.

Bodies that act on each other only move in the same way in every frame X(t) = X₀ + V₀ t. A number x on the device has an error
of 2⁻⁵³ |x|, so that two bodies 2,000 lengths from the origin have a separation with an error of 2·10⁻¹³ lengths, whatever
their distance is. In the frame of the centre of mass this error is 2⁻⁵³ of the extent of the system. X₀ and V₀ are rounded to
few bits, so that differences from them are exact.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from mpp_taichi.snapshot import Comoving, Snapshot

BITS = 30
"""Bits of a centre below the extent of the values. With so few bits, differences from the centre are exact, and the centre is
the same number of bits from the values wherever the origin is. With so many bits, a system leaves its frame only after some
10⁹ times the time in which its particles cross it."""
SPLITTER = 2.0**27 + 1.0  # divides the 53 bits of a float into halves
SPLIT_FROM, SPLIT_TO = 1e-120, 1e120  # sizes of numbers whose halves and products of halves are floats without loss


@dataclass(frozen=True, eq=False)
class MovingFrame:
    """The frame X₀ + V₀ τ of each replica, τ the time since the frame was chosen.

    origin, drift    X₀ [length] and V₀ [length / time], each (replica_count, dimensions)
    elapsed          τ of each replica as two numbers whose sum it is, (replica_count, 2) [time]. So τ does not depend on the
                     launches into which steps are divided
    kinetic_energy   of the first replica: the energy in the frame of the scene less the energy in this frame, () [energy]
    """

    origin: np.ndarray
    drift: np.ndarray
    elapsed: np.ndarray
    kinetic_energy: np.ndarray

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """All numbers, from which `MovingFrame(*arrays)` makes the frame again."""
        return self.origin, self.drift, self.elapsed, self.kinetic_energy

    @property
    def rests_at_origin(self) -> bool:
        """Whether positions and velocities are the same in this frame and in the frame of the scene."""
        return not (self.origin.any() or self.drift.any())

    @property
    def place(self) -> np.ndarray:
        """X₀ + V₀ τ, (replica_count, dimensions) [length]."""
        return self.origin + self.drift * self.elapsed[:, :1]

    def later(self, steps: int, dt: float) -> "MovingFrame":
        """The frame after so many steps of the length `dt`."""
        high, low = product_in_two(float(steps), float(dt))
        if len(self.elapsed) == 1:  # floats: small arrays take longer than the steps of a short launch
            earlier, rest = self.elapsed[0].tolist()
            elapsed = np.array([_sum_in_two(earlier, rest, high, low)])
        else:
            elapsed = np.stack(_sum_in_two(self.elapsed[:, 0], self.elapsed[:, 1], high, low), axis=1)
        return MovingFrame(self.origin, self.drift, elapsed, self.kinetic_energy)

    def seen_from_scene(
        self, replica: int, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, Comoving]:
        """Positions and velocities of a replica, given in this frame, in the frame of the scene, and both in this frame.

        All are (particle_count, 3).
        """
        origin, drift, place = np.zeros((3, 3))
        for padded, values in ((origin, self.origin), (drift, self.drift), (place, self.place)):
            padded[: values.shape[1]] = values[replica]
        return position + place, velocity + drift, Comoving(origin, drift, self.elapsed[replica], position, velocity)


def product_in_two(a: float, b: float) -> tuple[float, float]:
    """The float nearest to a b, and its rounding error: their sum is a b, unless the error is below the smallest float.

    Every launch of steps asks for it, and fractions take longer than the steps of a short launch.
    Source: Dekker, Numer. Math. 18 (1971) 224.
    """
    high = a * b
    if not (SPLIT_FROM < abs(high) < SPLIT_TO and SPLIT_FROM < abs(a) < SPLIT_TO and SPLIT_FROM < abs(b) < SPLIT_TO):
        return high, float(Fraction(a) * Fraction(b) - Fraction(high)) if math.isfinite(high) else 0.0
    a_head, b_head = a * SPLITTER - (a * SPLITTER - a), b * SPLITTER - (b * SPLITTER - b)
    a_tail, b_tail = a - a_head, b - b_head
    return high, ((a_head * b_head - high) + a_head * b_tail + a_tail * b_head) + a_tail * b_tail


def frame_of_center(
    position: np.ndarray, velocity: np.ndarray, mass: np.ndarray, known: MovingFrame | None = None
) -> tuple[MovingFrame, np.ndarray, np.ndarray]:
    """The frame of the centre of mass of each replica, and positions and velocities in it.

    Positions [length] and velocities [length / time] are (replica_count, particle_count, dimensions), masses (particle_count,),
    or (replica_count, particle_count). They are in the frame of the scene, or in a frame that is `known`.
    """
    masses = np.broadcast_to(mass, position.shape[:2])
    origin = np.stack([center(*each) for each in zip(position, masses, strict=True)])
    drift = np.stack([center(*each) for each in zip(velocity, masses, strict=True)])
    moved = position - origin[:, None], velocity - drift[:, None]
    if known is not None:
        origin, drift = known.place + origin, known.drift + drift
    return _started(origin, drift, moved[1][0], masses[0]), *moved


def frame_of_snapshots(starts: Sequence[Snapshot], dimensions: int) -> tuple[MovingFrame, np.ndarray, np.ndarray] | None:
    """The frame in which these particles were stepped before, and positions and velocities in it; a snapshot for each replica.

    None where a snapshot has no such frame, or has other positions or velocities by now.
    """
    kept = [each.comoving for each in starts if each.comoving is not None]
    if len(kept) != len(starts):
        return None
    origin, drift = (np.stack([getattr(each, name)[:dimensions] for each in kept]) for name in ("origin", "drift"))
    position, velocity = (np.stack([getattr(each, name)[:, :dimensions] for each in kept]) for name in ("position", "velocity"))
    frame = replace(_started(origin, drift, velocity[0], starts[0].mass), elapsed=np.stack([each.elapsed for each in kept]))
    for start, x, place, v, speed in zip(starts, position, frame.place, velocity, drift, strict=True):
        same = (x + place == start.position[:, :dimensions]) & (v + speed == start.velocity[:, :dimensions])
        if not same.all():
            return None
    return frame, position, velocity


def center(values: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Σ m x / Σ m of values (n, dimensions), (dimensions,), rounded to a multiple of 2⁻³⁰ of the extent of the values.

    The extent is the largest distance of a value from the centre. So x less the centre is exact for every value whose size is
    at least half of this difference; for smaller values it is rounded. The plain mean where there is no mass; 0 where a value
    is not finite.
    """
    weight = mass if mass.sum() > 0.0 else np.ones(len(values))
    reference = values[np.argmax(weight)]
    with np.errstate(over="ignore", invalid="ignore"):
        moments = weight[:, None] * (values - reference)
        if not np.isfinite(np.abs(moments).sum()):
            return np.zeros_like(reference)
        mean = reference + np.array([math.fsum(column) for column in moments.T]) / math.fsum(weight)
        extent = float(np.abs(values - mean).max())
        grid = math.ldexp(1.0, math.frexp(extent)[1] - BITS) if extent > 0.0 else 0.0
        counts = mean / grid if grid > 0.0 else np.full_like(mean, np.inf)
        return np.where(np.abs(counts) < 2.0**53, np.rint(counts) * grid, mean)


def _sum_in_two(earlier: Any, rest: Any, high: Any, low: Any) -> tuple[Any, Any]:
    """earlier + rest + high + low, as two numbers or arrays; what rounding takes away is added again (Knuth)."""
    total = earlier + high
    back = total - earlier
    rest = rest + low + ((earlier - (total - back)) + (high - back))
    whole = total + rest
    return whole, rest - (whole - total)


def _started(origin: np.ndarray, drift: np.ndarray, velocity: np.ndarray, mass: np.ndarray) -> MovingFrame:
    """A frame at τ = 0, for velocities relative to it of the first replica: K = K′ + V₀·Σ m v′ + ½ Σ m V₀² (König)."""
    with np.errstate(over="ignore", invalid="ignore"):
        kinetic_energy = drift[0] @ (mass @ velocity + 0.5 * mass.sum() * drift[0])
    return MovingFrame(origin, drift, np.zeros((len(origin), 2)), np.asarray(kinetic_energy))
