"""The keys of a repeat, and its JSON Schema."""

from typing import Any

from mpp_taichi.scene.fields import Whole

WORD, COUNT, VARIABLE, ENTRIES = "repeat", "count", "as", "entries"
VARIABLE_WHEN_ABSENT = "i"
KEYS = ("particles", "springs", "walls")
"""Keys of a scene whose lists may have repeats."""
SUMMARY = "Entries that differ by a number: one component, `entries:` or another `repeat:`, written out for each value of it."
DESCRIPTIONS = {
    COUNT: "number of repetitions, or an expression; the variable counts from 0 to count − 1",
    VARIABLE: 'name of the variable, for expressions such as 0.1 * i, and in braces in names: "ball_{i}", "ball_{i + 1}"',
    ENTRIES: "several entries of this list, in place of one component; all are made for each value of the variable",
    WORD: "a repeat in this repeat, with a variable of another name",
}


def with_repeats(schema: dict[str, Any], entries: dict[str, str]) -> None:
    """Let every list of a scene's schema have repeats; `entries` has the definition of the list's entries for each key."""
    for key, definition in entries.items():
        entry = schema["$defs"][definition]
        name = f"RepeatIn{key.capitalize()}"
        described = {
            COUNT: {**Whole(minimum=0).schema(), "description": DESCRIPTIONS[COUNT]},
            VARIABLE: {"type": "string", "default": VARIABLE_WHEN_ABSENT, "description": DESCRIPTIONS[VARIABLE]},
        }
        contents = {
            **entry["properties"],
            ENTRIES: {
                "type": "array",
                "items": {"$ref": f"#/$defs/{definition}"},
                "description": DESCRIPTIONS[ENTRIES],
            },
            WORD: {"$ref": f"#/$defs/{name}", "description": DESCRIPTIONS[WORD]},
        }
        schema["$defs"][name] = {
            "additionalProperties": False,
            "description": SUMMARY,
            "oneOf": [{"required": [each]} for each in contents],
            "properties": {**described, **contents},
            "required": [COUNT],
            "title": name,
            "type": "object",
        }
        entry["properties"][WORD] = {"$ref": f"#/$defs/{name}"}
