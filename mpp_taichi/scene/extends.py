"""`extends: base.yaml`: a scene that completes another scene of its folder, or a bundled scene (`extends: ring`)."""

from pathlib import Path

from mpp_taichi.scene.bundled import bundled_scenes
from mpp_taichi.scene.document import Node, read_file
from mpp_taichi.scene.faults import Faults, shown

DEEPEST = 4


def resolve(tree: Node, file: Path, root: Path, faults: Faults, chain: tuple[Path, ...] = ()) -> Node:
    """The tree merged over the scene that it extends: mappings merge, other values are replaced.

    The other scene is a file below `root`, or a bundled scene where there is no such file.
    """
    node = tree.get("extends")
    if node is None:
        return tree
    rest = tree.with_value({key: child for key, child in tree.value.items() if key != "extends"})
    chain = (*chain, _resolved(file))
    name = node.value
    if not isinstance(name, str):
        faults.add(node.location, "extends", f"must be the name of a scene file, not {shown(node.plain())}")
        return rest
    path = _resolved(file.parent / name) if "\0" not in name else file
    shown_name = str(file.parent / name)
    if name in bundled_scenes() and not _is_file(path):
        path = _resolved(bundled_scenes()[name])
        root, shown_name = path.parent, str(path)
    if path in chain:
        faults.add(node.location, "extends", f"{shown(name)} leads back to itself")
    elif not path.is_relative_to(_resolved(root)):
        faults.add(node.location, "extends", f"{shown(name)} is outside the scene's folder")
    elif len(chain) > DEEPEST:
        faults.add(node.location, "extends", f"more than {DEEPEST} scenes extend one another")
    elif not _is_file(path):
        faults.add(node.location, "extends", f"there is no file {shown(name)}")
    else:
        base = resolve(read_file(path, shown_name, faults), path, root, faults, chain)
        return merge(base, rest)
    return rest


def merge(base: Node, over: Node, key: str = "") -> Node:
    """`over` completed by `base`: mappings key by key, other values as in `over`; a different integrator replaces the entry."""
    if not isinstance(base.value, dict) or not isinstance(over.value, dict):
        return over
    if key == "integrator" and base.value.keys() != over.value.keys():
        return over
    merged = dict(base.value)
    for name, child in over.value.items():
        merged[name] = merge(merged[name], child, name) if name in merged else child
    return over.with_value(merged)


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):
        return path


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
