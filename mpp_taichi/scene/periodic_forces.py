"""Checks of pair forces in a periodic box, where a particle acts on the nearest copy of each other particle."""

import math

from mpp_taichi import component
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec


def box_of_pair_forces(spec: SceneSpec) -> ComponentSpec | None:
    """The periodic box through whose faces pair forces of the scene act, or None."""
    boxes = [wall for wall in spec.walls if wall.flag("walls", "repeats")]
    return boxes[0] if boxes and any(is_pair_force(force.name) for force in spec.forces) else None


def acts_across_faces(spec: SceneSpec) -> bool:
    """Whether pair forces of the scene act through the faces of a periodic box."""
    return box_of_pair_forces(spec) is not None


def check_periodic_forces(spec: SceneSpec, faults: Faults) -> None:
    """Refuse pair forces in a periodic box that have no cutoff, or a cutoff beyond half of an edge, and unfit methods."""
    box = box_of_pair_forces(spec)
    if box is None:
        return
    lower, upper, axes = (box.parameters[name] for name in ("lower", "upper", "axes"))
    half = min((upper[k] - lower[k]) / 2.0 for k in range(spec.dimensions) if axes[k])
    for number, force in enumerate(spec.forces):
        if not is_pair_force(force.name):
            continue
        key, reach = f"forces[{number}].{force.name}", math.inf if force.law is None else force.law.fixed_reach
        if not math.isfinite(reach):
            rule = "would act on endless copies of each particle in a periodic_box"
            faults.add(force.location, key, f"{rule}, allowed: with a fixed cutoff of at most half an edge")
        elif reach > half:
            rule = f"has a cutoff of {reach:g}, but in the periodic_box only the nearest copy of a particle is felt"
            faults.add(force.location, key, f"{rule}, allowed: at most half of the shortest edge, {half:g}")
    if not spec.integrator.flag("integrators", "can_use_tree"):
        instead = ", ".join(component.proposed("integrators", "tree"))
        rule = f"cannot step pair forces in a periodic_box, which lists of neighbours sum, allowed: {instead}, among others"
        faults.add(spec.integrator.location, f"integrator.{spec.integrator.name}", rule)
