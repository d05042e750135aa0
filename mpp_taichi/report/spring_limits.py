"""The springs that broke or yielded in a run, in its closing summary."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


def spring_limit_facts(simulation: "Simulation") -> dict[str, Any]:
    """{"spring_limits": {…}} for scenes whose springs break or yield: how many did, when first, and the energy lost.

    broken_count, yielded_count   springs that have broken, and springs whose rest length has changed
    first_break                   time at which the first spring broke [time], None where none did
    largest_plastic_strain        largest change of a rest length, over the rest length at the start
    lost_energy                   potential energy of springs lost by breaking and yielding [energy]
    """
    before = simulation.start.springs
    if not before.have_limits:
        return {}
    now = simulation.snapshot().springs
    change = np.abs(now.rest_length - before.rest_length) / before.rest_length
    broken = np.sort(now.breaking_times)
    yielded = now.rest_length.astype(np.float32) != before.rest_length.astype(np.float32)
    return {
        "spring_limits": {
            "broken_count": len(broken),
            "yielded_count": int(yielded.sum()),
            "first_break": float(broken[0]) if len(broken) else None,
            "largest_plastic_strain": float(change[yielded].max(initial=0.0)),
            "lost_energy": simulation.phase.lost_by_springs,
        }
    }


def spring_limit_line(found: Mapping[str, Any]) -> str:
    """`12 of 84 broke, the first at t = 0.31; 5 yielded, by up to 0.02 of their length; 3.2 of energy lost`."""
    facts = found.get("spring_limits")
    if facts is None:
        return ""
    told = f"{facts['broken_count']:,} of {found['spring_count']:,} broke"
    if facts["first_break"] is not None:
        told += f", the first at t = {facts['first_break']:.6g}"
    if facts["yielded_count"]:
        told += f"; {facts['yielded_count']:,} yielded, by up to {facts['largest_plastic_strain']:.3g} of their length"
    return f"{told}; {facts['lost_energy']:.6g} of energy lost"
