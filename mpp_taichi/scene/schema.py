"""The JSON Schema of scenes, for editors: written from the model and the components' declarations."""

import json
from pathlib import Path
from typing import Any

from mpp_taichi.scene import repeat_words
from mpp_taichi.scene.model import KIND_OF_KEY, all_components, scene_model
from mpp_taichi.scene.spec import EventSpec, ModesSpec, RecordSpec, RunSpec, SpringTypeSpec
from mpp_taichi.scene.view_spec import VIEW_SPECS

SCHEMA_FILE = Path(__file__).parent.parent / "scene.schema.json"


def scene_schema() -> dict[str, Any]:
    """The schema of all keys and components of this version and of `component.extra_folders`."""
    schema = scene_model(all_components()).model_json_schema(mode="validation")
    for described in (EventSpec, ModesSpec, RecordSpec, RunSpec, SpringTypeSpec, *VIEW_SPECS.values()):  # pydantic may not
        schema["$defs"][described.__name__]["description"] = described.__doc__
    repeat_words.with_repeats(schema, {key: f"{KIND_OF_KEY[key].capitalize()}Entry" for key in repeat_words.KEYS})
    schema["anyOf"] = [{"required": schema.pop("required")}, {"required": ["extends"]}]  # the base may hold the missing keys
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def write() -> None:
    """Write the schema of the package: `python -m mpp_taichi.scene.schema`."""
    SCHEMA_FILE.write_text(schema_text(), encoding="utf-8")


def schema_text() -> str:
    """The text of the schema of the package."""
    return json.dumps(scene_schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    write()
