"""Laws: the law of each force whose text is a formula, and the faults of such texts.

A formula stands in the scene, as a parameter of the type Law or LawVector, or in the file of a force: its literal `formula` is
a potential, and its literal `formulas` are three accelerations, which come on top. Meanings are the parameters of the force,
those of a vector as NAME_x, NAME_y and NAME_z, and for a formula of the scene its `parameters`, kept as `parameters.NAME`.
"""

from collections.abc import Iterator
from typing import Any

from mpp_taichi import component
from mpp_taichi.arithmetic.point_function import PointFunction
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.expressions import ExpressionError
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.formulas.fields import FormulaText
from mpp_taichi.scene.formulas.meanings import Meanings

AXES = "xyz"
PREFIX = "parameters."
"""Before the name of a number of a formula, as a parameter of its force."""


def spread(name: str, parameters: dict[str, Any]) -> dict[str, Any]:
    """The parameters of a force, with each number of a formula as a parameter of its own."""
    found = dict(parameters)
    for each in component.declaration("forces", name).parameters:
        if each.type == "Numbers":
            found |= {PREFIX + key: value for key, value in (found.pop(each.name) or {}).items()}
    return found


def movable(entry: Any) -> Iterator[component.Parameter]:
    """The parameters of a force that a kernel can load while it runs, each number of a formula as one of them."""
    for each in component.declaration("forces", entry.name).parameters:
        if each.slider and each.type != "Numbers":
            yield each
        elif each.slider:
            for name in entry.parameters:
                if name.startswith(PREFIX):
                    yield component.Parameter(name, "float", slider=True, unit=each.unit, help=each.help)


def is_formula(name: str) -> bool:
    """Whether a force of this name has its law from a formula."""
    return bool(component.flag("forces", name, "is_formula"))


def law_of(entry: Any) -> Any:
    """The law of a force; None where the force is no formula. Raises ExpressionError for a text that is no law.

    Imports SymPy where the force is a formula.
    """
    if not is_formula(entry.name):
        return None
    fixed, live = _numbers(entry)
    text = entry.parameters.get("potential")
    if component.declaration("forces", entry.name).base == "FormulaField":
        return _field_law(entry, fixed, live)
    if component.declaration("forces", entry.name).base == "FormulaBond":
        from mpp_taichi.scene.formulas.bond_law import bond_law

        return bond_law(str(text), fixed, live)
    from mpp_taichi.scene.formulas.pair_law import pair_law

    cutoff = entry.parameters.get("cutoff")
    written = str(text or component.flag("forces", entry.name, "formula"))
    return pair_law(written, fixed, live, None if cutoff is None else str(cutoff))


def _field_law(entry: Any, fixed: Meanings, live: tuple[str, ...]) -> Any:
    """The law of a field, whose formulas stand in the scene or, for three axes, in the file of the force."""
    from mpp_taichi.scene.formulas.external_law import external_law

    texts = texts_of(entry)
    if texts:
        return external_law(entry.parameters["potential"], entry.parameters["acceleration"], texts[0].dimensions, fixed, live)
    potential, acceleration = (component.flag("forces", entry.name, flag) for flag in ("formula", "formulas"))
    return external_law(potential, acceleration, 3, fixed, live)


def is_cut(error: ExpressionError) -> bool:
    """Whether a fault is in the formula of a cutoff."""
    return bool(getattr(error, "of_cutoff", False))


def live_names(entry: Any) -> dict[str, str]:
    """The names of a formula whose numbers may change in a run, with the attribute of the force that holds each."""
    return {name.removeprefix(PREFIX): name for name in entry.live if name != "softening"}


def _numbers(entry: Any) -> tuple[Meanings, tuple[str, ...]]:
    """Fixed numbers of a formula by name, and the names of those that are live."""
    given: dict[str, float | PointFunction] = {}
    cutoff = entry.parameters.get("cutoff")
    for text in (*texts_of(entry), *([] if cutoff is None else [cutoff])):
        given |= text.constants
    in_file = any(component.flag("forces", entry.name, flag) for flag in ("formula", "formulas"))
    for name, value in entry.parameters.items():
        if name.startswith(PREFIX) or (isinstance(value, float) and in_file):
            given[name.removeprefix(PREFIX)] = value
        elif in_file and isinstance(value, tuple) and len(value) == len(AXES):
            given |= {f"{name}_{axis}": float(each) for axis, each in zip(AXES, value, strict=True)}
    live = tuple(name for name in live_names(entry) if name in given)
    return tuple(sorted((name, value) for name, value in given.items() if name not in live)), live


def texts_of(entry: Any) -> list[FormulaText]:
    """The formulas that stand in a scene for a force."""
    found = []
    for key, value in entry.parameters.items():
        if key != "cutoff":
            found += [each for each in (value if isinstance(value, tuple) else (value,)) if isinstance(each, FormulaText)]
    return found


def check(entries: Any, tree: Node, faults: Faults) -> None:
    """Add a fault for each formula that is no law, at the character in its text."""
    node = tree.get("forces")
    for number, entry in enumerate(entries):
        if not is_formula(entry.name):
            continue
        body = node.value[number].value[entry.name] if node is not None else tree
        key = f"forces[{number}].{entry.name}"
        if _has_names(entry, body, key, faults) and _has_one_text(entry, key, faults):
            _check_law(entry, body, key, faults)


def _has_one_text(entry: Any, key: str, faults: Faults) -> bool:
    if "acceleration" not in entry.parameters:
        return True
    given = [name for name in ("potential", "acceleration") if entry.parameters[name] is not None]
    if len(given) != 1:
        faults.add(entry.location, key, f"has {' and '.join(given) or 'no formula'}, must have potential or acceleration")
    return len(given) == 1


def _has_names(entry: Any, body: Node, key: str, faults: Faults) -> bool:
    """Whether no number has a name that the formula knows already."""
    taken = {name for each in component.declaration("forces", entry.name).parameters for name in each.names}
    wrong = [name.removeprefix(PREFIX) for name in entry.parameters if name.startswith(PREFIX)]
    wrong = [name for name in wrong if name in taken]
    for name in wrong:
        at = body.value["parameters"].value[name].place
        faults.add(at, f"{key}.parameters", f"{shown(name)} has a meaning of its own in this formula, choose another name")
    clash = sorted({name for text in texts_of(entry) for name in text.constants} & taken)
    if clash:
        told = f"{clash[0]} is a constant of the scene and a variable of this formula, rename the constant"
        faults.add(entry.location, key, told)
    return not wrong and not clash


def _check_law(entry: Any, body: Node, key: str, faults: Faults) -> None:
    written = [name for name in ("potential", "acceleration") if entry.parameters.get(name) is not None]
    place = (body.get(written[0]) or body) if written else body
    for text, node in zip(texts_of(entry), place.value if isinstance(place.value, list) else [place]):
        text.place = node.place_of(0)
    try:
        law_of(entry)
    except ExpressionError as error:
        if is_cut(error):
            place, written = body.value["cutoff"], ["cutoff"]
        name = ".".join([key, *written])
        if isinstance(place.value, list):
            which = getattr(error, "formula", 0)
            place, name = place.value[which], f"{name}[{which}]"
        own = str(error).replace("stand under constants:", "stand under parameters: or constants:")
        faults.add(place.place_of(error.offset), name, own)
