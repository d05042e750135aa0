"""Constants of a scene: numbers or expressions over other constants, resolved in the order of their dependence."""

import graphlib
import keyword
import math
from collections.abc import Mapping

from mpp_taichi.scene.document import Node
from mpp_taichi.scene.expressions import RESERVED, Expression, ExpressionError, UnresolvedConstant, parse
from mpp_taichi.scene.faults import Faults, shown

CONSTANTS_ALLOWED = 10_000


def resolve(node: Node | None, given: Mapping[str, float | None], faults: Faults) -> dict[str, float | None]:
    """The value of every constant, `given` (G) or of the mapping; None for a constant whose fault is reported."""
    values: dict[str, float | None] = dict(given)
    if node is None or not isinstance(node.value, dict):
        if node is not None and node.value is not None:
            faults.add(node.location, "constants", f"must be a mapping of names to numbers, not {shown(node.plain())}")
        return values
    if len(node.value) > CONSTANTS_ALLOWED:
        faults.add(node.location, "constants", f"{len(node.value)} constants are too many, allowed: {CONSTANTS_ALLOWED}")
        return values
    expressions: dict[str, Expression] = {}
    for name, entry in node.value.items():
        values[name] = None
        key = f"constants.{name}"
        if not name.isidentifier() or keyword.iskeyword(name):
            faults.add(entry.place, key, f"{shown(name)} cannot be a name, allowed: letters, digits and _, a letter first")
        elif name in RESERVED or name in given:
            faults.add(entry.place, key, f"{shown(name)} means something already, choose another name")
        elif isinstance(entry.value, str):
            try:
                expressions[name] = parse(entry.value)
            except ExpressionError as error:
                faults.add(entry.place_of(error.offset), key, str(error))
        elif isinstance(entry.value, bool) or not isinstance(entry.value, (int, float)):
            faults.add(entry.location, key, f"must be a number or an expression, not {shown(entry.plain())}")
        elif not abs(entry.value) < 1e308 or math.isnan(entry.value):
            faults.add(entry.location, key, f"{shown(entry.value)} is not a finite number")
        else:
            values[name] = float(entry.value)
    for name in _in_order(expressions, node, faults):
        try:
            values[name] = expressions[name].number(values)
        except UnresolvedConstant:
            continue  # the fault stands where that constant is defined
        except ExpressionError as error:
            faults.add(node.value[name].place_of(error.offset), f"constants.{name}", str(error))
    return values


def _in_order(expressions: dict[str, Expression], node: Node, faults: Faults) -> list[str]:
    depends = {name: expression.names & expressions.keys() for name, expression in expressions.items()}
    while True:
        try:
            return list(graphlib.TopologicalSorter(depends).static_order())
        except graphlib.CycleError as error:
            cycle = error.args[1]
            place = node.value[cycle[0]].place
            faults.add(place, f"constants.{cycle[0]}", f"depends on itself: {' → '.join(cycle[:10])}")
            for name in cycle:
                depends.pop(name, None)
