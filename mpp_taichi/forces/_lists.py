"""Whether lists of neighbours suit the pair forces of a phase: forces that all end at a cutoff, between many particles."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.errors import UnsupportedError
from mpp_taichi.forces._base import PairForce
from mpp_taichi.precision import carries_low_parts
from mpp_taichi.walls._base import Enclosure

FEWEST = 500  # particles; with fewer, the direct sum is as fast
LARGEST_SHARE = 0.25  # of all pairs that are in the lists; with more, the direct sum, which reads in order, is faster


@dataclass(frozen=True)
class Lists:
    """The sizes of lists of neighbours."""

    reach: float
    """The largest cutoff [length]."""
    box: Enclosure | None
    """The box that repeats, in which forces act on the nearest copies."""


def lists_for(phase: Any, forces: Sequence[Any], *, asked: str) -> Lists | None:
    """The lists that suit these forces of a CompiledPhase, or None; `asked` is the plan that was asked for.

    Lists serve one system that all threads step together, without derivatives, low parts and mergers. In a periodic box nothing
    else knows the copies of a particle: there UnsupportedError says what cannot be had.
    """
    reach = max((force.reach for force in forces if isinstance(force, PairForce)), default=math.inf)
    if not math.isfinite(reach):
        return None
    method = phase.integrator
    reasons = {
        "several copies of the system": phase.replica_count > 1,
        "the tangent of the step": phase.has_tangent,
        f"the precision {phase.device.precision}": carries_low_parts(phase.device.precision),
        f"the method {phase.spec.integrator.name}": not (method.can_use_tree and method.launchers.parallel),
        "bodies that merge": phase.particles.merged_into is not None,
        "the plan serial": asked == "serial",
    }
    refused = next((reason for reason, holds in reasons.items() if holds), "")
    if phase.phase.box is not None:
        if refused:
            raise UnsupportedError(f"pair forces in a periodic_box are summed over lists of neighbours, without {refused}")
        return Lists(reach, phase.phase.box)
    position = phase.particles.position[:, : phase.spec.dimensions]
    return Lists(reach, None) if not refused and _are_few(position, reach) else None


def _are_few(position: np.ndarray, reach: float) -> bool:
    """Whether a list holds so few of all pairs that it is faster, as estimated for particles that fill the box around them."""
    if len(position) < FEWEST:
        return False
    extent = np.ptp(position, axis=0)
    return float(np.prod(np.minimum(1.0, 2.0 * reach / np.maximum(extent, reach)))) <= LARGEST_SHARE
