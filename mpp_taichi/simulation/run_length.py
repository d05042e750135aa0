"""Run length: how far a call of `run` goes, from its arguments or from the scene, and in how many steps."""

import math

from mpp_taichi.errors import CapacityError, MppError
from mpp_taichi.scene.contacts import LOOKS
from mpp_taichi.scene.spec import RunSpec
from mpp_taichi.scene.timeline import whole_steps
from mpp_taichi.wording.told_apart import told_apart

MOST_STEPS = 2.0**53
"""Steps beyond which time + dt is no new number; a machine would take years."""


def time_and_steps(
    asked: RunSpec, now: float, duration: float | None, until: float | None, steps: int | None
) -> tuple[float, float]:
    """The time that a run takes and the steps that it makes; one of the two is infinite.

    Raises:
        MppError: the arguments contradict each other, or there is no such run.
    """
    if sum(argument is not None for argument in (duration, until, steps)) > 1:
        raise MppError("run takes one of duration, until and steps")
    if duration is None and until is None and steps is None:
        duration, steps = asked.duration, asked.steps
        if duration is None and steps is None:
            raise MppError("the scene has no run.duration, so say how long: duration, until or steps")
    if steps is not None:
        if steps < 0:
            raise MppError(f"steps must not be negative, got {steps}")
        return math.inf, steps
    span = float(duration) if duration is not None else float(until or 0.0) - now
    if not math.isfinite(span) or span < 0.0:
        raise MppError(f"cannot run for a time of {span}")
    return span, math.inf


def interval_of(span: float) -> float:
    """The time between samples of a method that takes no equal steps, for a run of a time that the scene does not know.

    Raises:
        MppError: the run has no length in time.
    """
    if not math.isfinite(span):
        raise MppError(
            "the method chooses its own steps, and the scene has neither dt nor run.duration: give duration or until"
        )
    return span / LOOKS if span > 0.0 else 1.0


def steps_to(span: float, steps: float, to_next_phase: float, dt: float) -> tuple[float, float, bool]:
    """The way of a run to the end of its phase, or to its own end where this is nearer: after `span`, or after `steps`.

    The whole steps, the length of a shorter last step, or 0, and whether it is the number of `steps` that ends the run.

    Raises:
        CapacityError: more steps than the clock can tell apart.
    """
    leg = min(span, to_next_phase)
    if leg < math.inf and not leg / dt <= MOST_STEPS:
        steps_needed, most = told_apart(leg / dt, MOST_STEPS, digits=3)
        raise CapacityError(f"a time of {leg:.6g} is {steps_needed} steps of dt = {dt:.6g}, allowed: {most}; take a longer dt")
    whole, rest = whole_steps(leg, dt) if leg < math.inf else (steps, 0.0)
    return (steps, 0.0, True) if steps < whole + (rest > 0.0) else (whole, rest, False)
