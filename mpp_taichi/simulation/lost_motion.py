"""Lost motion: changes of a step that round to nothing, so that a particle stays where it is and nothing says so. Host side.

A number x of 24 or 53 bits changes by h only where |h| is at least half the spacing of the numbers at x, ½ ulp(x). A particle
at x = 10⁶ in f32 (spacing 0.06) with v dt = 0.01 does not move at all, for as long as the run takes.
"""

from typing import Any

import numpy as np

from mpp_taichi.precision import carries_low_parts, number_type
from mpp_taichi.simulation import first_bad_step
from mpp_taichi.simulation.verdict import RunFinding
from mpp_taichi.snapshot import Snapshot

SLOW = 0.1
"""Share of the largest speed or acceleration below which a particle may stay at rest: it does not matter to the motion."""
LOW_PART = 2.0**-24
"""Spacing of a number with a low part over the spacing of its high part."""


def spacing(values: np.ndarray, precision: str) -> np.ndarray:
    """Distance of each value from the next number of the precision."""
    if number_type(precision) == "f64":
        return np.spacing(np.abs(values))
    with np.errstate(over="ignore"):
        coarse = np.spacing(np.abs(values).astype(np.float32)).astype(float)
    return coarse * LOW_PART if carries_low_parts(precision) else coarse


def is_lost(values: np.ndarray, rates: np.ndarray, dt: float, free: np.ndarray, precision: str) -> np.ndarray:
    """Whether the change of a step, rate × dt, rounds to nothing along the axis where it is largest, (n,).

    Particles that are slower than `SLOW` of the fastest, at rest or held, are not counted.
    """
    rates = np.where(free, rates, 0.0)
    with np.errstate(over="ignore", invalid="ignore"):
        change, size = np.abs(rates) * dt, np.linalg.norm(rates, axis=1)
        rows, axis = np.arange(len(rates)), np.argmax(np.abs(rates), axis=1)
        matters = (size > 0.0) & (size >= SLOW * size.max(initial=0.0))
        return matters & (change[rows, axis] < 0.5 * spacing(values, precision)[rows, axis])


def finding(snapshot: Snapshot, *, dt: float, precision: str, uniform: Any) -> RunFinding | None:
    """The finding for particles whose positions, or velocities under a `uniform` acceleration (3,), would stay as they are.

    Positions and velocities are those of the frame in which the particles are stepped. Massive particles at rest that other
    forces will move are not judged.
    """
    stepped = snapshot if snapshot.comoving is None else snapshot.comoving
    pull = np.broadcast_to(np.asarray(uniform, float), snapshot.velocity.shape)
    judged = (("position", stepped.position, stepped.velocity), ("velocity", stepped.velocity, pull))
    for name, values, rates in judged:
        lost = is_lost(values, rates, dt, snapshot.free, precision)
        if lost.any():
            return _told(name, values, rates, lost, snapshot, dt, precision)
    return None


def _told(
    name: str, values: np.ndarray, rates: np.ndarray, lost: np.ndarray, snapshot: Snapshot, dt: float, precision: str
) -> RunFinding:
    particle = int(np.argmax(lost))
    axis = int(np.argmax(np.abs(rates[particle])))
    count = int(lost.sum())
    more = f" (and {count - 1:,} more)" if count > 1 else ""
    gap = spacing(values, precision)[particle, axis]
    text = (
        f"the {name} of {first_bad_step.label(snapshot, particle)}{more} would not change: a step of dt = {dt:.6g} changes "
        f"{values[particle, axis]:.9g} by {rates[particle, axis] * dt:.3g}, and numbers in {precision} are {gap:.3g} apart "
        "there; take a longer dt, more digits or an origin that is nearer"
    )
    return RunFinding("rounding", text, snapshot.time, particle)
