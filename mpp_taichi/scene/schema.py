"""The JSON Schema of scenes, for editors: written from the model and the components' declarations."""

import json
from pathlib import Path
from typing import Any

from mpp_taichi.scene import bare_names, repeat_words
from mpp_taichi.scene.model import KIND_OF_KEY, all_components, scene_model
from mpp_taichi.scene.spec import EventSpec, ModesSpec, RecordSpec, RunSpec, SpringTypeSpec
from mpp_taichi.scene.view_spec import VIEW_SPECS
from mpp_taichi.version import __version__

SCHEMA_FILE = Path(__file__).parent.parent / "scene.schema.json"


def scene_schema() -> dict[str, Any]:
    """The schema of all keys and components of this version and of `component.extra_folders`."""
    schema = scene_model(all_components()).model_json_schema(mode="validation")
    for described in (EventSpec, ModesSpec, RecordSpec, RunSpec, SpringTypeSpec, *VIEW_SPECS.values()):  # pydantic may not
        schema["$defs"][described.__name__]["description"] = described.__doc__
    repeat_words.with_repeats(schema, {key: f"{KIND_OF_KEY[key].capitalize()}Entry" for key in repeat_words.KEYS})
    _with_bare_names(schema)
    schema["anyOf"] = [{"required": schema.pop("required")}, {"required": ["extends"]}]  # the base may hold the missing keys
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"urn:mpp-taichi:scene:{__version__}", **schema}


def _with_bare_names(schema: dict[str, Any]) -> None:
    """Let the name of a component whose parameters all have defaults stand for an entry: `- newtonian_gravity`."""
    for key, kind in KIND_OF_KEY.items():
        entry = schema["$defs"].get(f"{kind.capitalize()}Entry", {"properties": {}})
        reference = {"$ref": f"#/$defs/{kind.capitalize()}Entry"}
        definitions = {name: schema["$defs"][each["$ref"].rpartition("/")[2]] for name, each in entry["properties"].items()}
        names = [name for name, definition in definitions.items() if not definition.get("required")]
        bare = {"type": "string", "enum": names, "description": "a component with the defaults of all its parameters"}
        allowed = schema["properties"][key]
        if names and key in bare_names.LISTS:
            allowed["items"] = {"anyOf": [reference, bare]}
        elif names and reference in allowed.get("anyOf", ()):
            allowed["anyOf"].append(bare)


def write() -> None:
    """Write the schema of the package: `python -m mpp_taichi.scene.schema`."""
    SCHEMA_FILE.write_text(schema_text(), encoding="utf-8")


def schema_text() -> str:
    """The text of the schema of the package."""
    return json.dumps(scene_schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    write()
