"""The integrators that a window offers for a scene, and the scene with another one of them."""

from collections.abc import Mapping
from typing import Any

from mpp_taichi import component
from mpp_taichi.errors import MppError
from mpp_taichi.scene.load import load_resolved
from mpp_taichi.scene.sliders import value_of
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.start.assemble import assemble


def with_method(written: SceneSpec, present: SceneSpec, name: str, dt: float) -> SceneSpec:
    """The scene as it was `written`, with another integrator and step, and with the values that sliders have at `present`.

    Parameters that the scene gives to this integrator are kept. A slider of the integrator is left out: the integrator that it
    belongs to may be gone.

    Raises:
        SceneError: the integrator cannot run the scene.
    """
    resolved = dict(written.resolved)
    given = resolved.get("integrator")
    kept = given.get(name) if isinstance(given, Mapping) else None
    resolved["integrator"] = {name: {**(kept or {}), "dt": dt}}
    if "sliders" in resolved:
        resolved["sliders"] = [each for each in resolved["sliders"] if not _is_of_method(each["set"])]
    moved: dict[str, Any] = {}
    for slider in written.sliders:
        value = value_of(present, slider.targets[0])
        if not _is_of_method(slider.path) and value != value_of(written, slider.targets[0]):
            moved[slider.path] = value
    return load_resolved(resolved, written.source, overrides=moved)


def refusal(written: SceneSpec, name: str, dt: float) -> str:
    """The reason why an integrator cannot run a scene with a step; empty where it can."""
    try:
        spec = with_method(written, written, name, dt)
        if component.flag("integrators", name, "made_for"):
            assemble(spec)  # the bodies must suit the method as well
    except MppError as error:
        return str(error).splitlines()[0]
    return ""


def about(name: str) -> str:
    """The first line of an integrator's description, and the meaning of its step where that is no time step."""
    told = component.declaration("integrators", name)
    dt = next(parameter.help for parameter in told.parameters if parameter.name == "dt")
    return f"{told.summary.partition(chr(10))[0]} dt: {dt}"


def _is_of_method(path: str) -> bool:
    return path.startswith("integrator")
