"""Check of the steps of a run before it begins, in every phase that the run will reach."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mpp_taichi import component
from mpp_taichi.cli._goal import Goal
from mpp_taichi.scene import timeline
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation.course import Phase
from mpp_taichi.stability import advise, check_step
from mpp_taichi.stability.advice import StepAdvice

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


def spans(phases: Sequence[Phase], goal: Goal, first: int = 0) -> list[tuple[Phase, float]]:
    """The phases that a run reaches, from number `first` on, and the time that it spends in each; infinite without an end."""
    end = goal.begin + goal.span(phases[0].spec) if not goal.endless else math.inf
    found: list[tuple[Phase, float]] = []
    for phase, following in zip(phases[first:], (*(later.at for later in phases[first + 1 :]), math.inf)):
        begins = max(phase.at, goal.begin)
        if begins < end or not found:
            found.append((phase, max(0.0, min(end, following) - begins)))
    return found


def check_steps(simulation: "Simulation", goal: Goal, *, force: bool) -> int | None:
    """Warn of steps that are too large, or refuse them, in every phase; returns the number of steps of a run with an end.

    Later phases are checked with the particles at their initial places; the simulation checks them again when they begin.

    Raises:
        StabilityError: a step is unstable, and `force` is not set.
    """
    total = 0
    for phase, span in spans(simulation.phases, goal, simulation.phase_number):
        dt = simulation.dt if total == 0 else _dt(phase.spec)
        steps = steps_in(span, dt)
        if total == 0:
            simulation.check_step(steps)
        else:
            check_step(phase.spec, phase.particles, method_of(phase.spec), dt, steps=steps, force=force, begins=phase.at)
        if steps is None:
            return None
        total += max(1, steps)
    return total


def advice_of(phase: Phase) -> StepAdvice | None:
    """The advice on the step of a phase with the particles at their initial places; imports Taichi, but starts no device."""
    return advise(phase.spec, phase.particles, method_of(phase.spec), _dt(phase.spec), begins=max(0.0, phase.at))


def method_of(spec: SceneSpec) -> Any:
    """The integrator of a scene, whose amplification of an oscillator is asked."""
    return component.build("integrators", spec.integrator.name, spec.integrator.parameters)


def steps_in(span: float, dt: float) -> int | None:
    """The number of steps in a span of time; None for an infinite span or too large a number."""
    if not math.isfinite(span / dt):
        return None
    whole, rest = timeline.whole_steps(span, dt)
    return whole + (rest > 0.0)


def _dt(spec: SceneSpec) -> float:
    return float(spec.integrator.parameters["dt"])
