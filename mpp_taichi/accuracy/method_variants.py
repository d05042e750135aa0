"""Method variants: an integrator with parameters of its own as a method, `wisdom_holman+lazy`.

An integrator names its variants by its flag `variants`, each with the parameters in which it differs from the defaults.
"""

from typing import Any

from mpp_taichi import component

MARK = "+"


def variants_of(integrator: str) -> dict[str, dict[str, Any]]:
    """The parameters of each variant of an integrator, by the name of the method."""
    named = component.flag("integrators", integrator, "variants", {})
    return {f"{integrator}{MARK}{name}": parameters for name, parameters in named.items()}


def split_variant(method: str) -> tuple[str, dict[str, Any]]:
    """Integrator and parameters of a variant; of another method its own name, and no parameters."""
    integrator, mark, _ = method.partition(MARK)
    known = variants_of(integrator) if mark and integrator in component.names("integrators") else {}
    return (integrator, known[method]) if method in known else (method, {})
