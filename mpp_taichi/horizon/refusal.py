"""Refusals: scenes in which runs with other steps would show nothing, or nothing right."""

from typing import TYPE_CHECKING

from mpp_taichi.scene.tree_checks import tree_of
from mpp_taichi.stability.step_limit import spectral_radius

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

DAMPED = 0.5  # of an amplitude, left after one step: with this step and with half of it the oscillation soon is gone


def refusal(simulation: "Simulation") -> str:
    """The reason why a scene has no horizon that reruns could find; empty where there is none."""
    for phase in simulation.phases:
        if tree_of(phase.spec) is not None:
            return "gravity by a tree has an error of its own, which does not depend on the step"
    if not simulation.start.free.any():
        return "no particle moves"
    return _damped(simulation)


def _damped(simulation: "Simulation") -> str:
    """The method takes the energy of stiff springs out within a few steps, whatever the step is: all reruns agree."""
    integrator, advice = simulation.integrator, simulation.step_advice
    if advice is None or not integrator.stable_for_any_stiffness:
        return ""
    left = spectral_radius(integrator.amplification(advice.network.frequency * simulation.dt))
    if left > DAMPED:
        return ""
    return (
        f"{simulation.spec.integrator.name} leaves {left:.1g} of the stiffest oscillation after a step, so that runs with "
        "other steps agree where none of them is right"
    )
