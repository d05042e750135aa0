"""Whether a sum over fewer than all pairs suits the pair forces of a phase: over lists of neighbours, or between groups."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.errors import UnsupportedError
from mpp_taichi.forces._base import PairForce
from mpp_taichi.precision import carries_low_parts
from mpp_taichi.walls._base import Enclosure

FEWEST = 500  # particles of lists; with fewer, the direct sum is as fast
FEWEST_BETWEEN = 32  # particles of groups; with fewer, the direct sum stays in registers
LARGEST_SHARE = 0.25  # of all pairs; with more, the direct sum, which reads in order and in lanes, is faster


@dataclass(frozen=True)
class Lists:
    """Lists of neighbours, for forces that all end at a cutoff."""

    solver = "lists"
    reach: float
    """The largest cutoff [length]."""
    box: Enclosure | None
    """The box that repeats, in which forces act on the nearest copies."""


@dataclass(frozen=True)
class Between:
    """The forces all act between two groups."""

    solver = "between"
    forces: tuple[PairForce, ...]


def fewer_pairs(phase: Any, forces: Sequence[Any], *, asked: str) -> Lists | Between | None:
    """The sum over fewer pairs that suits these forces of a CompiledPhase, or None; `asked` is the plan that was asked for.

    It serves one system, without derivatives, low parts and mergers, with lists only where all threads step it together. In a
    periodic box nothing but lists knows the copies of a particle: there UnsupportedError says what cannot be had.
    """
    pairs = tuple(force for force in forces if isinstance(force, PairForce))
    reach = max((force.reach for force in pairs), default=math.inf)
    method = phase.integrator
    reasons = {
        "several copies of the system": phase.replica_count > 1,
        "the tangent of the step": phase.has_tangent,
        f"the precision {phase.device.precision}": carries_low_parts(phase.device.precision),
        f"the method {phase.spec.integrator.name}": not method.can_use_tree,
        "bodies that merge": phase.particles.merged_into is not None,
    }
    together = {
        f"the method {phase.spec.integrator.name}": not method.launchers.parallel,
        "the plan serial": asked == "serial",
    }
    refused = [reason for reason, holds in (*reasons.items(), *together.items()) if holds]
    box, position = phase.phase.box, phase.particles.position[:, : phase.spec.dimensions]
    if box is not None and refused:
        raise UnsupportedError(f"pair forces in a periodic_box are summed over lists of neighbours, without {refused[0]}")
    if box is not None or (not refused and _are_few_near(position, reach)):
        return Lists(reach, box)
    if not any(reasons.values()) and _are_few_between(pairs, len(position)):
        return Between(pairs)
    return None


def _are_few_near(position: np.ndarray, reach: float) -> bool:
    """Whether lists hold a small share of all pairs, as estimated for particles that fill the box around them evenly."""
    if len(position) < FEWEST or not math.isfinite(reach):
        return False
    extent = np.ptp(position, axis=0)
    return float(np.prod(np.minimum(1.0, 2.0 * reach / np.maximum(extent, reach)))) <= LARGEST_SHARE


def _are_few_between(pairs: Sequence[Any], count: int) -> bool:
    """Whether all forces act between groups, which have a small share of all pairs; each pair is visited from both ends."""
    groups = [getattr(force, "between", None) for force in pairs]
    if not pairs or None in groups or count < FEWEST_BETWEEN:
        return False
    return sum(2 * one[1] * other[1] for one, other in groups) <= LARGEST_SHARE * count * (count - 1)
