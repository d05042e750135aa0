"""Checks of walls that move as formulas of the time say."""

from typing import Any

from mpp_taichi import component
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.path_checks import check_formulas_of_time
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec


def moved_walls(spec: SceneSpec) -> list[tuple[int, ComponentSpec]]:
    """Number and entry of each wall with a `motion`."""
    return [(number, wall) for number, wall in enumerate(spec.walls) if wall.parameters.get("motion") is not None]


def functions_of_motions(spec: SceneSpec) -> list[str]:
    """The functions beyond arithmetic and roots that motions of walls call, such as sin."""
    laws = [_law(wall) for _, wall in moved_walls(spec)]
    return list(dict.fromkeys(name for law in laws for name in law.functions))


def check_wall_motions(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    """Refuse motions that are no finite numbers during the run, or beside a velocity or a solver that does not know them."""
    moved = moved_walls(spec)
    if not moved:
        return
    solver = None if spec.contacts is None else spec.contacts.solver
    for number, wall in moved:
        key = f"walls[{number}].{wall.name}.motion"
        if any(wall.parameters["velocity"]):
            faults.add(wall.location, key, "is beside a velocity, leave one of them out: a motion may have a term v*t")
        if solver is not None and not solver.flag("contacts", "takes_motions"):
            allowed = ", ".join(component.marked("contacts", "takes_motions"))
            faults.add(wall.location, key, f"goes with the solvers {allowed}, not {solver.name}")
        check_formulas_of_time(spec, "walls", number, wall, "motion", tree, faults)


def _law(wall: ComponentSpec) -> Any:
    from mpp_taichi.scene.formulas.path_law import path_law  # with SymPy, only where a wall has a motion

    return path_law(wall.parameters["motion"])
