"""The check of the angle of a wall that turns."""

from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.path_checks import checked_law
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec

PARTS = {"x": "the angle", "x′": "the rate of the angle", "x″": "the change of the rate of the angle"}  # of a path of one axis


def check_angle(spec: SceneSpec, number: int, wall: ComponentSpec, tree: Node, faults: Faults) -> None:
    """Refuse an angle that is no formula of the time, or that is no finite number at some time of the run."""
    angle, key = wall.parameters["turning"].angle, f"walls[{number}].{wall.name}.turning.angle"
    walls = tree.get("walls")
    turning = None if walls is None else walls.value[number].value[wall.name].get("turning")
    node = None if turning is None else turning.get("angle")
    checked_law(spec, (angle,), [node or Node(None, wall.location)], [key], faults, noun="an angle", parts=PARTS)
