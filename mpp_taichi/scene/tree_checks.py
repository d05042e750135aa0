"""Checks of gravity by a tree against the other parts of a scene, without compilation."""

from mpp_taichi import component
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec

VISITS_OF_A_TREE = 3000
"""The approximate number of nodes and bodies whose pull on a particle is computed at an accuracy of 1e-3."""
DEFAULT_ACCURACY = 1e-3
"""The default of the relative error of the force that 99 % of the particles keep."""


def tree_of(spec: SceneSpec) -> ComponentSpec | None:
    """The force of the scene that a tree sums, if there is one."""
    return next((force for force in spec.forces if force.parameters.get("solver") == "tree"), None)


def check_tree(spec: SceneSpec, faults: Faults) -> None:
    """Refuse integrators, forces and contacts that a tree does not support, and an accuracy of the direct sum."""
    for force in spec.forces:
        if force.parameters.get("accuracy") is not None and force.parameters.get("solver") == "direct":
            faults.add(
                force.location, f"{force.name}.accuracy", "the direct sum has none to choose, allowed: with solver: tree"
            )
    tree = tree_of(spec)
    if tree is None:
        return
    key = f"{tree.name}.solver"
    method = spec.integrator.name
    if not spec.integrator.flag("integrators", "can_use_tree"):
        instead = ", ".join(component.proposed("integrators", "tree"))
        rule = f"sums accelerations for steps of equal length, not for {method}, allowed: {instead}, among others"
        faults.add(tree.location, key, f"tree {rule}")
    others = [f.name for f in spec.forces if f is not tree and is_pair_force(f.name)]
    if others:
        faults.add(tree.location, key, f"tree sums only gravity, not beside {', '.join(others)}, allowed: direct")
    if spec.contacts is not None and spec.contacts.solver.flag("contacts", "merges"):
        faults.add(tree.location, key, "tree does not know bodies that merge, allowed: direct")
