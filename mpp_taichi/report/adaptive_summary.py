"""The step control of an adaptive method, for the summary of a run. Host side."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


def step_control(simulation: "Simulation") -> dict[str, Any]:
    """Steps taken and refused, evaluations of the force and the mean step of the phase; {} without step control."""
    found = simulation.launcher.facts().get("step_control") if simulation.step_count else None
    return {} if found is None else {"step_control": found}


def step_control_line(found: Mapping[str, Any]) -> str:
    """`1,234 steps of its own, 2 refused, 27,148 evaluations of the force; the last is 0.0123 long`."""
    control = found.get("step_control")
    if not control:
        return ""
    several = f" in {control['replicas']:,} replicas" if control["replicas"] > 1 else ""
    return (
        f"{control['steps']:,} steps of its own{several}, {control['refused']:,} refused, "
        f"{control['force_evaluations']:,} evaluations of the force; the last step is {control['last_step']:.3g}"
    )
