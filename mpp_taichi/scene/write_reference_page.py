"""The scene reference, docs/scene.md: written from the JSON Schema and the components' own declarations."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mpp_taichi import component
from mpp_taichi.scene.expectations import REDUCTION_FIELDS, SUMMARY_QUANTITIES
from mpp_taichi.scene.reference_guides import repeats, unit_words
from mpp_taichi.scene.schema import scene_schema
from mpp_taichi.scene.view_spec import VIEW_SPECS

REFERENCE_FILE = Path(__file__).parents[2] / "docs" / "scene.md"
KIND_TITLES = {
    "generators": "Particles: entries of `particles:`",
    "networks": "Springs: entries of `springs:`",
    "forces": "Forces: entries of `forces:`",
    "contacts": "Contact solvers: `solver:` of `contacts: {hard_spheres: …}`",
    "walls": "Walls: entries of `walls:`",
    "integrators": "Integrators: `integrator:`",
    "quantities": "Quantities: for `inspect:`, `record.table` and `expect:`",
    "diagnostics": "Diagnostics of a whole run: further keys of `expect:`",
}
SPECS = {
    "functions.NAME": "FunctionSpec",
    "spring_types.NAME": "SpringTypeSpec",
    "run": "RunSpec",
    "timeline": "EventSpec",
    **{key: described.__name__ for key, described in VIEW_SPECS.items()},
    "record": "RecordSpec",
    "record.table": "TableColumns",
    "modes": "ModesSpec",
    "inspect": "Panel",
    "sliders": "Slider",
}
INTRODUCTION = """# Scene reference

Written from the model by `python -m mpp_taichi.scene.write_reference_page`; do not edit.

A scene is one YAML mapping. Every number may be an expression in quotes or without, over `constants:`, `pi`, `tau`, `e` and
`sqrt sin cos tan atan2 exp log hypot min max abs`; a power is `^` or `**`. The [guide to units](#units) says which units the
numbers have. Entries that differ by a number are written as one
[repeat](#repeat-an-entry-of-particles-springs-and-walls). A particle is
named by its index, its `name`, or `group[index]`; a group by its name, and `group[first:end]` is a part of it, without the end.
Lists of components are lists of one-key mappings, `- name: {parameters}`. `extends:` takes another scene of the folder as
the base: mappings merge, lists replace. `--set path=value` changes any key from the command line; `+path` adds an entry.
`timeline:` changes such paths while the scene runs: each change begins a phase, which is compiled as a step of its own. Forces,
springs, the integrator, constants and the particles' masses, charges, radii, colours and held axes may change; a force whose
strength is set to 0 is no part of the phase. In `{…}`, write `forces.linear_drag.coefficient` rather than `forces[0].…`.
"""


def reference_text() -> str:
    """The text of the page."""
    return (
        "\n".join([INTRODUCTION, *_keys(), *repeats(), *unit_words(), *_specs(), *_components(), *_summary_quantities()]) + "\n"
    )


def _keys() -> Iterator[str]:
    yield "## Keys\n\n| key | default | meaning |\n|---|---|---|"
    schema = scene_schema()
    for key, entry in schema["properties"].items():
        default = "**required**" if key in schema["anyOf"][0]["required"] else _shown(entry.get("default"))
        yield f"| `{key}` | {default} | {entry.get('description', '')} |"


def _specs() -> Iterator[str]:
    definitions = scene_schema()["$defs"]
    for key, name in SPECS.items():
        yield f"\n### `{key}:`\n\n{_first_line(definitions[name]['description'])}\n\n| key | default | meaning |\n|---|---|---|"
        for entry, described in definitions[name]["properties"].items():
            default = "**required**" if entry in definitions[name].get("required", ()) else _shown(described.get("default"))
            yield f"| `{entry}` | {default} | {described.get('description', '')} |"


def _components() -> Iterator[str]:
    for kind in component.KINDS:
        yield f"\n## {KIND_TITLES[kind]}"
        if kind == "quantities":
            yield from _reductions()
        for name in component.names(kind):
            declared = component.declaration(kind, name)
            if declared.base == "BondForce":  # springs act by themselves
                continue
            yield f"\n### `{name}`\n\n{_paragraphs(declared.summary)}"
            if declared.parameters:
                yield "\n| parameter | type | default | unit | meaning |\n|---|---|---|---|---|"
            for parameter in declared.parameters:
                yield _row(parameter)


def _row(parameter: component.Parameter) -> str:
    required = parameter.default is component.REQUIRED
    default = "**required**" if required else "" if parameter.default is None else _shown(parameter.default)
    limits = [f"≥ {parameter.minimum:g}"] if parameter.minimum is not None else []
    limits += [f"> {parameter.above:g}"] if parameter.above is not None else []
    limits += [f"≤ {parameter.maximum:g}"] if parameter.maximum is not None else []
    limits += [" or ".join(map(str, parameter.choices))] if parameter.choices else []
    limits += ["a slider may move it"] if parameter.slider else []
    meaning = "; ".join(part for part in (parameter.help, ", ".join(limits)) if part)
    return f"| `{parameter.name}` | {parameter.type} | {default} | {parameter.unit} | {meaning} |"


def _reductions() -> Iterator[str]:
    yield "\nAs a key of `expect:` a quantity has, beside its own parameters and the bounds, the keys\n"
    yield "| key | default | meaning |\n|---|---|---|"
    for name, (_, described) in REDUCTION_FIELDS.items():
        yield f"| `{name}` | {_shown(described.default)} | {described.description} |"


def _summary_quantities() -> Iterator[str]:
    yield "\n### Quantities of every run\n\n| quantity | meaning |\n|---|---|"
    for name, meaning in SUMMARY_QUANTITIES.items():
        yield f"| `{name}` | {meaning} |"


def _shown(value: Any) -> str:
    return "" if value in (None, "", [], {}) or isinstance(value, dict) else f"`{str(value).lower()}`"


def _first_line(text: str) -> str:
    return text.strip().splitlines()[0]


def _paragraphs(text: str) -> str:
    return "\n".join(line.strip() for line in text.strip().splitlines())


def write() -> None:
    """Write the page."""
    REFERENCE_FILE.write_text(reference_text(), encoding="utf-8")


if __name__ == "__main__":
    write()
