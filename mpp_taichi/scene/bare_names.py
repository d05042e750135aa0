"""Names without parameters: `- newtonian_gravity` in place of `- newtonian_gravity: {}`, and `integrator: ias15`."""

from mpp_taichi.scene.document import Node
from mpp_taichi.scene.model import KIND_OF_KEY, available

LISTS = ("particles", "springs", "forces", "walls")


def expanded(tree: Node) -> Node:
    """The tree in which every entry that is the mere name of a component is a mapping of this name to no parameters."""
    changed = {}
    for key in LISTS:
        node = tree.get(key)
        if node is not None and isinstance(node.value, list) and any(_is_bare(each, key) for each in node.value):
            changed[key] = node.with_value([_entry(each) if _is_bare(each, key) else each for each in node.value])
    node = tree.get("integrator")
    if node is not None and _is_bare(node, "integrator"):
        changed["integrator"] = _entry(node)
    return tree.with_value({**tree.value, **changed}) if changed else tree


def _is_bare(node: Node, key: str) -> bool:
    return node.row is None and isinstance(node.value, str) and node.value in available(KIND_OF_KEY[key])


def _entry(node: Node) -> Node:
    return node.with_value({node.value: Node({}, node.location, node.location)})
