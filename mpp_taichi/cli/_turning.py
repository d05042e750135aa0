"""The warning of a film in which a body turns too far between two frames."""

import math

from mpp_taichi.cli._terminal import say

FRAMES_OF_A_TURN = 6  # of a revolution, with which an eye follows it


def tell_turn(name: str, turns: float, *, fps: float, quiet: bool) -> None:
    """Say which body turns so far between two frames that its motion cannot be followed."""
    if quiet:
        return
    shown = math.ceil(fps * turns * FRAMES_OF_A_TURN)
    say(f"warning: {name} turns {turns:.2f} times between two frames; --fps {shown} shows its path")
