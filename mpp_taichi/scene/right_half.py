"""Right half: the settings by which `--beside` and `record: {beside: …}` change a scene for the right half of a film.

They are the paths of `--set`, and also `integrator: rk4`, the method with the step of the left half, `dt: 0.01`, and
`backend`, `precision`, `plan` and `threads`, which are options of the command line for the left half.
"""

import re
from collections.abc import Callable, Mapping
from typing import Any

import yaml

from mpp_taichi import precision
from mpp_taichi.device.availability import BACKENDS
from mpp_taichi.device.thread_count import allowed_threads, most_threads
from mpp_taichi.errors import SceneError
from mpp_taichi.scene import overrides
from mpp_taichi.scene.document import Node, read_value
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.spec import SceneSpec

DEVICE_SETTINGS: dict[str, tuple[str, ...]] = {
    "backend": ("auto", *BACKENDS),
    "precision": precision.PRECISIONS,
    "plan": ("auto", "serial", "parallel"),
    "threads": (),
}
SHARED = (
    "title",
    "dimensions",
    "units",
    "run",
    "view",
    "record",
    "inspect",
    "expect",
    "modes",
    "sliders",
    "accuracy",
    "horizon",
)
"""Keys of a scene that both halves share: the length of the run, its view and its measurements."""
_WORD = re.compile(r"[a-z]\w*", re.ASCII)
_COUNT = re.compile(r"[0-9]{1,9}")


def refusal(key: str, value: str) -> str:
    """The reason why a setting cannot be changed in the right half; empty if it can."""
    first = (overrides.steps(key.removeprefix("+")) or ("",))[0]
    if first in SHARED:
        return f"both halves have the same {first}"
    if key == "threads" and not (_COUNT.fullmatch(value) and 1 <= int(value) <= most_threads()):
        return f"must be {allowed_threads()}"
    if DEVICE_SETTINGS.get(key) and value not in DEVICE_SETTINGS[key]:
        return f"{value!r} is none of {', '.join(DEVICE_SETTINGS[key])}"
    return ""


def in_scene(key: str, value: str, integrator: str, dt: float) -> tuple[str, str, str]:
    """The change that a setting makes: the path, the value as YAML, and the name of the right half's method after it.

    `integrator` is the name of the method before, `dt` the step of the left half.
    """
    if key == "integrator" and _WORD.fullmatch(value):
        return key, f"{{{value}: {{dt: {dt!r}}}}}", value
    if key == "dt":
        return f"integrator.{integrator}.dt", value, integrator
    return key, value, integrator


def as_texts(given: Mapping[str, Any] | None) -> list[str]:
    """The settings of `record: {beside: …}` as texts of `--beside`; the method comes before its step."""
    return [f"{key}={_text(value)}" for key, value in _method_first(given or {})]


def check(spec: SceneSpec, tree: Node, faults: Faults, load: Callable[[Node], SceneSpec]) -> None:
    """Add the faults of `record: {beside: …}`: the right half must be a valid scene; `load` makes a scene from a tree."""
    if not spec.record.beside:
        return
    record = tree.value["record"]
    given = record.value["beside"]
    alone = record.with_value({key: node for key, node in record.value.items() if key != "beside"})
    right = tree.with_value({**tree.value, "record": alone})
    name, dt = spec.integrator.name, spec.integrator.parameters["dt"]
    for key, node in _method_first(given.value):
        value = _text(node.plain())
        if problem := refusal(key, value):
            faults.add(node.location, f"record.beside.{key}", problem)
        elif key not in DEVICE_SETTINGS:
            path, text, name = in_scene(key, value, name, dt)
            if not overrides.steps(path.removeprefix("+").strip()):
                faults.add(node.place, f"record.beside.{key}", f"{shown(key)} is no path, as in forces.linear_drag.coefficient")
                continue
            right = overrides.put(right, path, node if text == value else read_value(text, node.location), faults)
    faults.raise_if_any()
    try:
        load(right)
    except SceneError as error:
        said = (f"{fault} (in the right half, record.beside)" for fault in error.faults)
        raise SceneError(*said, excerpts=error.excerpts) from None


def _method_first(given: Mapping[str, Any]) -> list[tuple[str, Any]]:
    return sorted(((str(key), value) for key, value in given.items()), key=lambda setting: setting[0] != "integrator")


def _text(value: Any) -> str:
    """A value as a text for `--set`."""
    return yaml.safe_dump(value, default_flow_style=True, width=10**6, sort_keys=False).removesuffix("...\n").strip()
