"""Checks of bodies whose path, mass or charge is a given function of the time: bad formulas, and what excludes them."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mpp_taichi.scene.asked_quantities import tangent_quantities
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.expressions import ExpressionError
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec

MOST_DRIVEN = 32
"""Bodies on paths in a scene: the formulas of each are a part of the kernels, which take longer to compile with each body."""
TIMES_TRIED = 1001  # from 0 to the end of the run, at which a path must have a place, a velocity and an acceleration


def paths_of(spec: SceneSpec) -> list[Any]:
    """The paths (PathLaw) of all bodies that are on one, in the order of the scene; SymPy is imported where there is one."""
    if not spec.driven_entries:
        return []
    from mpp_taichi.scene.formulas.path_law import path_law

    return [path_law(entry.parameters["path"]) for _number, entry in spec.driven_entries]


def check_changing_numbers(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    """Refuse masses and charges that are no finite numbers during the run, and parts of a scene that do not go with them."""
    if not spec.changing_entries:
        return
    given = []
    for number, entry, quantity in spec.changing_entries:
        parameter = f"{quantity}_factor"
        key = f"particles[{number}].{entry.name}.{parameter}"
        given.append((key, entry))
        if not entry.parameters[quantity]:
            faults.add(entry.location, key, f"multiplies a {quantity} of 0, so nothing would change")
        law = check_formulas_of_time(spec, "particles", number, entry, parameter, tree, faults)
        if law is not None and quantity == "mass":
            times = times_of_run(spec)
            factor = law.rows_at(times)[0]
            if factor.min() <= 0.0:
                k = int(np.argmax(factor <= 0.0))
                told = f"the factor is {factor[k]:.6g} at t = {times[k]:g}, must be above 0 at all times"
                faults.add(entry.parameters[parameter].place, key, told)
    _number, _entry, first = spec.changing_entries[0]
    _check_together(spec, given, f"a {first} that changes", "masses and charges of the scene change", faults)


def check_paths(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    """Refuse paths that are no finite numbers during the run, and parts of a scene that do not go with bodies on paths."""
    for number, entry in spec.driven_entries:
        check_formulas_of_time(spec, "particles", number, entry, "path", tree, faults)
        _check_mass(spec, number, entry, faults)
    given = [(f"particles[{number}].{entry.name}.path", entry) for number, entry in spec.driven_entries]
    _check_together(spec, given, "a body on a path", "bodies of the scene are on a path", faults)


def _check_together(
    spec: SceneSpec, given: Sequence[tuple[str, ComponentSpec]], what: str, counted: str, faults: Faults
) -> None:
    """Refuse parts of a scene that do not go with the `given` functions of the time, by key and entry, and too many of them."""
    for key, entry in given[:1]:
        for reason in _reasons(spec, what):
            faults.add(entry.location, key, reason)
    for key, entry in given[MOST_DRIVEN : MOST_DRIVEN + 1]:
        faults.add(entry.location, key, f"{len(given)} {counted}, allowed: {MOST_DRIVEN}")


def _reasons(spec: SceneSpec, what: str) -> Iterator[str]:
    """The parts of a scene beside which a body cannot be `what`, a function of the time."""
    is_path = what == "a body on a path"
    if spec.contacts is not None:
        yield f"{what} cannot be beside contacts:" + (", for it would have to push spheres that it meets" if is_path else "")
    for name in (wall.name for wall in spec.walls if wall.flag("walls", "repeats")):
        yield f"{what} cannot be in a {name}" + (", whose faces it may cross" if is_path else "")
    if spec.move_to_center_of_mass and is_path:
        yield "a path is given in the frame of the scene, so move_to_center_of_mass is not allowed beside it"
    if spec.accuracy is not None:
        rule = "do not move bodies on a path" if is_path else f"do not know {what}"
        yield f"accuracy: compares methods that {rule}, choose the integrator yourself"
    if wanted := tangent_quantities(spec):
        rule = "which bodies on a path do not have" if is_path else f"which {what} does not have"
        yield f"{' and '.join(wanted)} needs the derivative of every step, {rule}"


def check_formulas_of_time(
    spec: SceneSpec, listed: str, number: int, entry: ComponentSpec, parameter: str, tree: Node, faults: Faults
) -> Any:
    """The law of the formulas of t that a parameter of an entry of the list `listed` has, one formula or one for each axis.

    The place of each formula is noted. A text that is no formula of t is refused, and a formula that is no finite number at
    some time of the run: then the result is None.
    """
    given, key = entry.parameters[parameter], f"{listed}[{number}].{entry.name}.{parameter}"
    texts = given if isinstance(given, tuple) else (given,)
    keys = [f"{key}[{which}]" for which in range(len(texts))] if isinstance(given, tuple) else [key]
    entries = tree.get(listed)
    node = None if entries is None else entries.value[number].value[entry.name].get(parameter)
    nodes = [node or tree] * len(texts) if node is None or not isinstance(node.value, list) else node.value
    return checked_law(spec, texts, nodes, keys, faults)


def checked_law(
    spec: SceneSpec,
    texts: Sequence[Any],
    nodes: Sequence[Node],
    keys: Sequence[str],
    faults: Faults,
    *,
    noun: str = "a path",
    parts: Mapping[str, str] | None = None,
) -> Any:
    """The law (PathLaw) of formulas of the time, which stand at `nodes` under `keys`; None where one is refused.

    Messages call the law `noun`, and its values and their derivatives by the words that `parts` has for x, x′ and x″.
    """
    from mpp_taichi.scene.formulas.path_law import path_law  # with SymPy, only where there is a formula of the time
    from mpp_taichi.scene.formulas.program import points_of

    for text, each in zip(texts, nodes):
        text.place = each.place_of(0)
    try:
        law = path_law(texts)
    except ExpressionError as error:
        which = getattr(error, "formula", 0)
        faults.add(nodes[which].place_of(error.offset), keys[which], str(error).replace("a path", noun))
        return None
    bad = law.first_bad(times_of_run(spec))
    if bad is not None:
        which, what, time = bad
        told = f"{(parts or {}).get(what, what)} is no finite number at t = {time:g}, must be one at all times"
        ends = [each.told for each in points_of(law) if not each.repeats]
        faults.add(texts[which].place, keys[which], "; ".join([told, *ends[:1]]))
        return None
    return law


def end_of_run(spec: SceneSpec) -> float:
    """The time at which a run ends as the scene says; 0 where it does not say when."""
    return spec.run.duration or (spec.run.steps or 0) * float(spec.integrator.parameters.get("dt") or 0.0)


def times_of_run(spec: SceneSpec) -> np.ndarray:
    """Times from the start to the end of a run, at which formulas of the time are tried."""
    end = end_of_run(spec)
    return np.linspace(0.0, end, TIMES_TRIED if end else 1)


def _check_mass(spec: SceneSpec, number: int, entry: ComponentSpec, faults: Faults) -> None:
    """Refuse a body without mass that has pair forces other than gravity: the force on it is computed from its acceleration."""
    others = [
        force.label for force in spec.forces if is_pair_force(force.name) and not force.flag("forces", "proportional_to_mass")
    ]
    if entry.parameters["mass"] == 0.0 and others:
        told = f"a body on a path needs a mass above 0 beside {others[0]}, for the work on it"
        faults.add(entry.location, f"particles[{number}].{entry.name}.mass", told)


def warned_kinks(spec: SceneSpec) -> Iterator[tuple[Any, str]]:
    """The place and the function of each kink in a path, a mass or a charge, at which a step loses its order."""
    if not (spec.driven_entries or spec.changing_entries):
        return
    from mpp_taichi.scene.formulas.grammar import kinks  # with SymPy

    given = [(number, entry, "path", text) for number, entry in spec.driven_entries for text in entry.parameters["path"]]
    for number, entry, quantity in spec.changing_entries:
        given.append((number, entry, f"{quantity}_factor", entry.parameters[f"{quantity}_factor"]))
    for number, entry, parameter, text in given:
        for name, _character in kinks(text.expression):
            key = f"particles[{number}].{entry.name}.{parameter}"
            yield text.place, f"{key}: {name} has a kink, at which a step loses its order"
