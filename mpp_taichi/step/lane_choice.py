"""Lane choice: whether several copies of a system move in the lanes of vector registers."""

from mpp_taichi.device.fast_taichi import switch
from mpp_taichi.step.launcher import Launcher

MOST_SCRATCH = 8
"""Scratch vectors of a method in lanes: with more, as of `dop853`, the compiler takes a minute."""


def may_have_lanes(launcher: Launcher) -> bool:
    """Whether the text of the step of several copies can be computed with lanes here (arithmetic/lanes.py)."""
    state, force = launcher.state, launcher.total_force
    if launcher.grain == 1 or not switch.is_on("explicit_vectors") or state.carries_low or force.has_rods:
        return False
    if force.pairs_in_tiles or state.own_springs or len(state.scratch) > MOST_SCRATCH:
        return False
    return launcher.integrator.takes_any_numbers and all(each.takes_any_numbers for each in force.forces)
