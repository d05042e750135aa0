"""The timeline of a scene in words: the changes at each time, and the effects that each phase is compiled from."""

from collections.abc import Mapping
from typing import Any

from mpp_taichi.scene.spec import SceneSpec


def described(spec: SceneSpec) -> list[dict[str, Any]]:
    """One entry for each event: its time, the changes (path → value), and the effects, integrator and dt after it."""
    return [
        {
            "at": event.at,
            "changes": event.changes,
            "effects": event.scene.effects(len(event.scene.springs)),
            "integrator": event.scene.integrator.name,
            "dt": float(event.scene.integrator.parameters["dt"]),
        }
        for event in spec.timeline
    ]


def phase_line(phase: Mapping[str, Any]) -> str:
    """`from t = 40: forces.linear_drag.coefficient = 0; then spring; leapfrog, dt 0.01`."""
    changes = ", ".join(f"{path} = {value}" for path, value in phase["changes"].items())
    effects = ", ".join(phase["effects"]) or "no effect"
    return f"from t = {phase['at']:.9g}: {changes}; then {effects}; {phase['integrator']}, dt {phase['dt']:.6g}"
