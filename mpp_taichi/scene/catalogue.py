"""Scenes by topic: what a list of scenes says of each file, without a check of the whole scene."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mpp_taichi import component
from mpp_taichi.errors import SceneError
from mpp_taichi.scene import extends
from mpp_taichi.scene.document import Node, read_file
from mpp_taichi.scene.faults import Faults, printable

TOPICS = ("Gravity", "Springs", "Hard spheres", "Other forces")


@dataclass(frozen=True)
class Listed:
    """A scene of a list: its name, file, title, description and topic. `fault` says why a file could not be read."""

    name: str
    file: Path
    title: str = ""
    description: str = ""
    topic: str = TOPICS[-1]
    fault: str = ""


def listed(files: Iterable[Path]) -> list[Listed]:
    """What is said of each of these files, in the order of the topics and, within a topic, of the names."""
    found = [_listed(file) for file in files]
    return sorted(found, key=lambda each: (TOPICS.index(each.topic), each.name))


def _listed(file: Path) -> Listed:
    faults = Faults()
    try:
        tree = extends.resolve(read_file(file, str(file), faults), file, file.parent, faults)
        faults.raise_if_any()
    except SceneError as error:
        return Listed(file.stem, file, fault=str(error).splitlines()[0])
    return Listed(file.stem, file, _text(tree, "title"), _text(tree, "description"), _topic(tree))


def _text(tree: Node, key: str) -> str:
    node = tree.get(key)
    return printable(" ".join(str(node.value).split())) if node is not None and isinstance(node.value, str) else ""


def _topic(tree: Node) -> str:
    """Contacts go before springs, and springs before gravity, since they are what such a scene shows."""
    if tree.get("contacts") is not None:
        return "Hard spheres"
    if tree.get("springs") is not None:
        return "Springs"
    forces = tree.get("forces")
    entries = forces.value if forces is not None and isinstance(forces.value, list) else []
    gravitating = component.marked("forces", "gravitates")
    return "Gravity" if any(_name(entry) in gravitating for entry in entries) else TOPICS[-1]


def _name(force: Node) -> str:
    """The name of a force, which stands alone or before its parameters."""
    if isinstance(force.value, dict):
        return str(next(iter(force.value), ""))
    return str(force.value)
