"""Copies in a repeat: an entry of a list once more, with other values for the variables of the repeats around it."""

from collections.abc import Mapping
from typing import Any

from mpp_taichi.scene.document import Node
from mpp_taichi.scene.expressions import ExpressionError
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.messages import key_text
from mpp_taichi.scene.repeat_text import NO_SHIFTS, Use, filled

Variables = Mapping[str, int]


class Copies:
    """Copies of nodes in which the variables have values."""

    def __init__(self, variables: Variables, constants: Mapping[str, float | None], faults: Faults) -> None:
        """Keep the values of the variables and constants, and the list to which faults are added."""
        self.variables, self.constants, self.faults = variables, constants, faults
        self.where = where(variables)

    def place(self, place: Location) -> Location:
        """A place with the values of the variables."""
        return Location(place.file, place.line, place.column, self.where)

    def of(self, node: Node, path: tuple[Any, ...], use: Use | Mapping[str, Use]) -> Node:
        """A copy of a node; `use` tells what its texts are, or of a mapping the texts of each key."""
        value, shifts = node.value, NO_SHIFTS
        if isinstance(value, dict):
            of_keys, default = (use, Use.NUMBER) if isinstance(use, Mapping) else ({}, use)
            value = {key: self.of(each, (*path, key), of_keys.get(key, default)) for key, each in value.items()}
        elif isinstance(value, list):
            below = Use.NUMBER if isinstance(use, Mapping) else use
            value = [self.of(each, (*path, number), below) for number, each in enumerate(value)]
        elif isinstance(value, str) and isinstance(use, Use):
            try:
                value, shifts = filled(value, self.variables, self.constants, use)
            except ExpressionError as error:
                self.faults.add(self.place(node.place_of(error.offset)), key_text(path), str(error))
        begins = None if node.key_location is None else self.place(node.key_location)
        return Node(value, self.place(node.location), begins, node.text_column, None, shifts)


def where(variables: Variables) -> str:
    """The values of the variables, as `Location` has them."""
    return ", ".join(f"{name} = {value}" for name, value in variables.items())
