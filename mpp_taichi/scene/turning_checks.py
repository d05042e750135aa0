"""The check of the angle of a wall that turns."""

from mpp_taichi.scene.document import Node
from mpp_taichi.scene.expressions import ExpressionError
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.path_checks import times_of_run
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec

PARTS = {"x": "the angle", "x′": "the rate of the angle", "x″": "the change of the rate of the angle"}  # of a path of one axis


def check_angle(spec: SceneSpec, number: int, wall: ComponentSpec, tree: Node, faults: Faults) -> None:
    """Refuse an angle that is no formula of the time, or that is no finite number at some time of the run."""
    from mpp_taichi.scene.formulas.path_law import path_law  # with SymPy, only where a wall turns
    from mpp_taichi.scene.formulas.program import points_of

    angle, key = wall.parameters["turning"].angle, f"walls[{number}].{wall.name}.turning.angle"
    walls = tree.get("walls")
    turning = None if walls is None else walls.value[number].value[wall.name].get("turning")
    node = None if turning is None else turning.get("angle")
    angle.place = wall.location if node is None else node.place_of(0)
    try:
        law = path_law((angle,))
    except ExpressionError as error:
        told = str(error).replace("a path", "an angle")
        faults.add(angle.place if node is None else node.place_of(error.offset), key, told)
        return
    bad = law.first_bad(times_of_run(spec))
    if bad is not None:
        _, what, time = bad
        told = f"{PARTS[what]} is no finite number at t = {time:g}, must be one at all times"
        ends = [each.told for each in points_of(law) if not each.repeats]
        faults.add(angle.place, key, "; ".join([told, *ends[:1]]))
