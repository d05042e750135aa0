"""What gravity by a tree does not go with, known without compiling anything."""

from mpp_taichi import component
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec

FAMILIES = ("Splitting", "RungeKutta")
"""Of integrators that ask for nothing but accelerations, all particles at once."""
VISITS_OF_A_TREE = 3000
"""Nodes and bodies whose pull on a particle is worked out, roughly, at an accuracy of 1e-3."""
DEFAULT_ACCURACY = 1e-3
"""Relative error of the force that 99 % of the particles keep, where the scene says nothing."""
INSTEAD = "leapfrog, yoshida4, rk4, dop853"


def tree_of(spec: SceneSpec) -> ComponentSpec | None:
    """The force of the scene that a tree sums, if there is one."""
    return next((force for force in spec.forces if force.parameters.get("solver") == "tree"), None)


def check_tree(spec: SceneSpec, faults: Faults) -> None:
    """Refuse what a tree cannot serve, and an accuracy where there is none."""
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
    if component.declaration("integrators", method).base not in FAMILIES:
        rule = f"sums accelerations for steps of equal length, not for {method}, allowed: {INSTEAD}, among others"
        faults.add(tree.location, key, f"tree {rule}")
    others = [f.name for f in spec.forces if f is not tree and is_pair_force(f.name)]
    if others:
        faults.add(tree.location, key, f"tree sums gravity alone, not beside {', '.join(others)}, allowed: direct")
    if spec.contacts is not None and spec.contacts.solver.name == "merging":
        faults.add(tree.location, key, "tree does not know bodies that merge, allowed: direct")
