"""Settings: the differences of the right half of a film, as `--beside` gives them, and the captions of both halves."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from mpp_taichi.errors import MppError, SceneError
from mpp_taichi.scene import overrides, repeat_words, right_half
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.right_half import DEVICE_SETTINGS
from mpp_taichi.scene.spec import SceneSpec

Captions = tuple[list[str], list[str]]
LONGEST_VALUE = 60  # letters in a caption


class BesideError(MppError):
    """`--beside` cannot be followed, or the right half of a film failed; `exit_code` is the code of the underlying error."""

    exit_code = 2

    def __init__(self, text: str, exit_code: int = 2) -> None:
        """Keep the text and the exit code."""
        super().__init__(text)
        self.exit_code = exit_code


@dataclass(frozen=True, eq=False)
class Beside:
    """The right half: the texts of `--beside`, its scene, and the options of its device that differ from the left half's."""

    said: tuple[str, ...]
    scene: SceneSpec
    device: dict[str, Any]

    def captions(self, left: SceneSpec, left_device: dict[str, Any], right_device: dict[str, Any]) -> Captions:
        """The lines below the two halves: each value that was set, as the half has it.

        The devices are given by their true `backend`, `precision`, `plan` and `threads`.
        """
        lines: Captions = ([], [])
        for text in self.said:
            key, _, value = text.partition("=")
            key = key.strip().removeprefix("+")
            for found, spec, device in zip(lines, (left, self.scene), (left_device, right_device)):
                line = f"{key}: {device[key]}" if key in DEVICE_SETTINGS else _told(key, spec)
                if repeat_words.WORD in overrides.steps(key):  # the text of a repeat, which is written out in both scenes
                    line = f"{key}: {_short(value.strip()) if spec is self.scene else 'as written'}"
                if line not in found:
                    found.append(line)
        return lines


def beside(left: SceneSpec, said: Sequence[str], source: Any, given: Sequence[str]) -> Beside:
    """The right half that the texts of `--beside` ask for; the left half was read from `source` with the overrides `given`.

    Raises:
        SceneError, BesideError: there is no such right half.
    """
    device: dict[str, Any] = {}
    own: dict[str, str] = {}  # override → its text
    name = left.integrator.name
    for text in said:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise BesideError(f"--beside {text}: must be path=value, as in integrator=rk4")
        if problem := right_half.refusal(key, value):
            where = "" if key in DEVICE_SETTINGS else ": set it with --set"
            raise BesideError(f"--beside {text}: {problem}{where}")
        if key in DEVICE_SETTINGS:
            device[key] = int(value) if key == "threads" else value
            continue
        path, written, name = right_half.in_scene(key, value, name, left.integrator.parameters["dt"])
        own[text if (path, written) == (key, value) else f"{path}={written}"] = text
    without = ["record.beside="] if left.record.beside else []
    try:
        scene = load_scene(source, overrides=[*given, *without, *own])
    except SceneError as error:
        raise SceneError(*(_as_said(fault, own) for fault in error.faults), excerpts=error.excerpts) from None
    return Beside(tuple(said), scene, device)


def _as_said(fault: str, own: dict[str, str]) -> str:
    """A fault, placed at the option that has caused it."""
    for override, text in own.items():
        place = f"--set {override}"
        if fault.startswith((f"{place}:", f"{place} (")):  # in a repeat the value of its variable stands behind it
            return f"--beside {text}{fault.removeprefix(place)}"
    return fault


def _told(key: str, spec: SceneSpec) -> str:
    """The value that a scene has at a path, in a few words."""
    if key == "dt" or key.partition(".")[0] == "integrator":
        parameters = {name: value for name, value in spec.integrator.parameters.items() if value is not None}
        return ", ".join([spec.integrator.name, *(f"{name} {_short(value)}" for name, value in parameters.items())])
    value = spec.resolved
    for step in overrides.steps(key):
        value = _entry(value, step)
    return f"{key}: {_short(value)}"


def _entry(value: Any, step: Any) -> Any:
    """The value below a key, an index, or the name of the only entry of a list with this name; None where there is none."""
    if isinstance(value, dict):
        return value.get(str(step))
    if not isinstance(value, list):
        return None
    if str(step).isdigit():
        return value[int(step)] if int(step) < len(value) else None
    named = [entry[step] for entry in value if isinstance(entry, dict) and step in entry]
    return named[0] if named else None


def _short(value: Any) -> str:
    """A value as text for a caption: `none` for an empty value."""
    if value is None or value in ([], {}, ""):
        return "none"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list) and all(isinstance(entry, dict) and len(entry) == 1 for entry in value):
        text = ", ".join(next(iter(entry)) for entry in value)
    elif isinstance(value, (dict, list)):
        text = yaml.safe_dump(value, default_flow_style=True, width=10**6, sort_keys=False).strip()
    else:
        text = str(value)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 1] + "…"
