"""Spring types: `type: steel` in an entry of `springs:` stands for the parameters in `spring_types: {steel: …}`."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from mpp_taichi.scene.did_you_mean import choices
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.spec import ComponentSpec, SpringTypeSpec

_SHARED = tuple(field.name for field in fields(SpringTypeSpec))


def resolve(
    entries: Sequence[ComponentSpec], types: Mapping[str, SpringTypeSpec], tree: Node, faults: Faults
) -> tuple[ComponentSpec, ...]:
    """The entries completed by their types; an entry's own parameters prevail. A missing type or stiffness is a fault."""
    return tuple(_completed(number, entry, types, tree, faults) for number, entry in enumerate(entries))


def _completed(
    number: int, entry: ComponentSpec, types: Mapping[str, SpringTypeSpec], tree: Node, faults: Faults
) -> ComponentSpec:
    said: Mapping[str, Node] = tree.value["springs"].value[number].value[entry.name].value or {}
    key = f"springs[{number}].{entry.name}"
    given: dict[str, Any] = {}
    name = entry.parameters.get("type")
    if name and name not in types:
        faults.add(said["type"].location, f"{key}.type", f"unknown spring type {shown(name)}{choices(name, types)}")
        return entry
    if name:
        shared = {each: getattr(types[name], each) for each in _SHARED}
        given = {each: value for each, value in shared.items() if value is not None and each in entry.parameters}
        given = {each: value for each, value in given.items() if each not in said}
    completed = {**entry.parameters, **given}
    if "stiffness" in completed and completed["stiffness"] is None:
        where = f", and its type {shown(name)} does not say it either" if name else ""
        faults.add(entry.location, key, f"missing key 'stiffness' (D){where}")
    return replace(entry, parameters=completed)
