"""Named numbers: the constants of a scene and G of its units, which expressions may use."""

from mpp_taichi.scene import constants, units
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults


def named_numbers(tree: Node, faults: Faults) -> dict[str, float | None]:
    """Every name with its number; None for a name whose fault is reported here, or by the check of `units:`."""
    given: dict[str, float | None] = {}
    if (node := tree.get("units")) is not None and node.value is not None:
        words = node.plain()
        try:
            given["G"] = units.gravitational_constant(words["length"], words["time"], words["mass"])
        except (KeyError, TypeError):
            given["G"] = None  # the check of `units:` reports the error
    return constants.resolve(tree.get("constants"), given, faults)
