"""Checks of walls that move as formulas of the time say."""

from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.expressions import ExpressionError
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.path_checks import TIMES_TRIED
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
        _check_formulas(spec, number, wall, tree, faults)


def _check_formulas(spec: SceneSpec, number: int, wall: ComponentSpec, tree: Node, faults: Faults) -> None:
    texts, key = wall.parameters["motion"], f"walls[{number}].{wall.name}.motion"
    listed = tree.get("walls")
    node = None if listed is None else listed.value[number].value[wall.name].get("motion")
    nodes = node.value if node is not None and isinstance(node.value, list) else [tree] * len(texts)
    for text, each in zip(texts, nodes):
        text.place = each.place_of(0)
    try:
        law = _law(wall)
    except ExpressionError as error:
        which = getattr(error, "formula", 0)
        faults.add(nodes[which].place_of(error.offset), f"{key}[{which}]", str(error))
        return
    end = spec.run.duration or (spec.run.steps or 0) * float(spec.integrator.parameters.get("dt") or 0.0)
    bad = law.first_bad(np.linspace(0.0, end, TIMES_TRIED if end else 1))
    if bad is not None:
        which, what, time = bad
        told = f"{what} is no finite number at t = {time:g}, must be one at all times"
        faults.add(texts[which].place, f"{key}[{which}]", told)


def _law(wall: ComponentSpec) -> Any:
    from mpp_taichi.scene.formulas.path_law import path_law  # with SymPy, only where a wall has a motion

    return path_law(wall.parameters["motion"])
