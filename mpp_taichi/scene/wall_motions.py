"""Checks of walls that move as formulas of the time say, that turn, and that have a friction."""

from typing import Any

from mpp_taichi import component
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.path_checks import check_formulas_of_time
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.scene.turning_checks import check_angle


def walls_with(spec: SceneSpec, parameter: str) -> list[tuple[int, ComponentSpec]]:
    """Number and entry of each wall that has a `motion`, a `turning` or a `friction`."""
    return [(number, wall) for number, wall in enumerate(spec.walls) if wall.parameters.get(parameter)]


def functions_of_motions(spec: SceneSpec) -> list[str]:
    """The functions beyond arithmetic and roots that motions of walls call, such as sin."""
    texts = [wall.parameters["motion"] for _, wall in walls_with(spec, "motion")]
    angles = [(wall.parameters["turning"].angle,) for _, wall in walls_with(spec, "turning")]
    called = [name for each in (*texts, *angles) for name in _law(each).functions]
    return list(dict.fromkeys([*called, *(("sin", "cos") if angles else ())]))


def check_wall_motions(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    """Refuse motions and turnings that are no finite numbers during the run, or beside a solver that does not know them."""
    for number, wall in walls_with(spec, "motion"):
        key = f"walls[{number}].{wall.name}.motion"
        if any(wall.parameters["velocity"]):
            faults.add(wall.location, key, "is beside a velocity, leave one of them out: a motion may have a term v*t")
        check_formulas_of_time(spec, "walls", number, wall, "motion", tree, faults)
    for number, wall in walls_with(spec, "turning"):
        check_angle(spec, number, wall, tree, faults)
    solver = None if spec.contacts is None else spec.contacts.solver
    for parameter, flag in (("motion", "motions"), ("turning", "turnings"), ("friction", "friction")):
        if solver is not None and not solver.flag("contacts", f"takes_{flag}"):
            allowed = ", ".join(component.marked("contacts", f"takes_{flag}"))
            for number, wall in walls_with(spec, parameter):
                told = f"goes with the solvers {allowed}, not {solver.name}"
                faults.add(wall.location, f"walls[{number}].{wall.name}.{parameter}", told)


def _law(texts: Any) -> Any:
    from mpp_taichi.scene.formulas.path_law import path_law  # with SymPy, only where a wall has a motion

    return path_law(texts)
