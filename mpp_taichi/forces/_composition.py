"""Composition: the forces that a scene names, imported and built."""

from typing import Any, cast

from mpp_taichi import component
from mpp_taichi.arithmetic.point_lookup import provide
from mpp_taichi.forces._base import ExternalForce, Force
from mpp_taichi.scene.formulas.laws import PREFIX, live_names
from mpp_taichi.scene.formulas.program import points_of
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.snapshot import Snapshot


def compose(spec: SceneSpec, snapshot: Snapshot) -> tuple[Force, ...]:
    """Import and build the forces that a scene names, and the force of its springs where it has springs."""
    forces = [built(entry) for entry in spec.forces]
    for force in forces:
        if isinstance(force, ExternalForce):
            force.see(snapshot)
    if len(snapshot.springs):
        damped = spec.damping_is_live or (snapshot.springs.damping != 0).any()
        damping = spec.spring_damping if damped else "none"
        forces += [
            component.build("forces", name, {"damping": damping}) for name in component.marked("forces", "acts_on_springs")
        ]
    return tuple(forces)


def built(entry: ComponentSpec) -> Force:
    """The force of an entry, with its law where the force is a formula."""
    plain = {name: value for name, value in entry.parameters.items() if not name.startswith(PREFIX)}
    force: Any = component.build("forces", entry.name, plain)
    if entry.law is not None:
        force.law, force.needs = entry.law, entry.law.needs
        force.live = {name: at for name, at in live_names(entry).items() if name in entry.law.live}
        vars(force).update(entry.law.flags)
        provide(points_of(entry.law))
    return cast(Force, force)
