"""Wanted quantities: the entries of `expect:` that `accuracy: {of: NAME, below: E}` is about."""

from mpp_taichi import component
from mpp_taichi.component import REQUIRED
from mpp_taichi.scene import expectations
from mpp_taichi.scene.did_you_mean import choices
from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.spec import Expectation, SceneSpec

GIVEN = frozenset({"steps", "time", "total_energy_initial"})
"""Quantities that the start or the length of the run gives, whatever the method is."""


def wanted_entries(spec: SceneSpec, name: str) -> tuple[Expectation, ...]:
    """The entries of `expect:` of this name, without repetitions, or the quantity with the defaults of its parameters.

    Raises:
        ValueError: there is no such quantity, no method changes it, or it needs parameters that no entry gives.
    """
    known = [each for each in expectations.names() if each not in GIVEN]
    if name in GIVEN:
        raise ValueError(f"{name} is the same for every method, so that it has no accuracy")
    if name not in known:
        raise ValueError(f"unknown quantity {shown(name)}{choices(name, known)}")
    found: list[Expectation] = []
    for each in spec.expect:
        if each.quantity == name and each.parameters not in [other.parameters for other in found]:
            found.append(each)
    return tuple(found) or (_by_defaults(name),)


def _by_defaults(name: str) -> Expectation:
    """The quantity with the defaults of its parameters."""
    kind = expectations.kind_of(name)
    declared = () if kind is None else component.declaration(kind, name).parameters
    if missing := [parameter.name for parameter in declared if parameter.default is REQUIRED]:
        entry = ", ".join(f"{each}: …" for each in missing)
        raise ValueError(f"{name} needs {' and '.join(missing)}: name it in expect: as well, as {name}: {{{entry}, …}}")
    parameters = {parameter.name: parameter.default for parameter in declared}
    if kind == "quantities":
        parameters |= expectations.reduction_keys(name)
    return Expectation(name, parameters, None, None, None, None, Location("accuracy", 0, 0))
