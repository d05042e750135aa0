"""Messages: the faults that pydantic found, expressed with the keys of the scene and placed at its lines."""

import dataclasses
import typing
from collections.abc import Callable, Iterable
from typing import Any

from pydantic import BaseModel, ValidationError

from mpp_taichi import component
from mpp_taichi.scene import expectations
from mpp_taichi.scene.did_you_mean import allowed, choices
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.model import KIND_OF_KEY, available
from mpp_taichi.scene.repeat_words import KEYS, WORD

_KIND_WORDS = {
    "generators": "generator of particles",
    "networks": "generator of springs or rods",
    "forces": "force",
    "integrators": "integrator",
    "walls": "wall",
    "quantities": "quantity",
}

_Path = tuple[Any, ...]
EXAMINED = 1000  # faults for which a message is composed; the others are only counted


def report(
    error: ValidationError, tree: Node, model: type[BaseModel], faults: Faults, place_of: Callable[[_Path], _Path]
) -> None:
    """Add every fault that a ValidationError holds; `place_of` gives the path in the tree for a path that the error names."""
    details = error.errors(include_url=False, include_input=False)
    faults.more += max(len(details) - EXAMINED, 0)
    for detail in details[:EXAMINED]:
        detail["loc"] = place_of(detail["loc"])
        place = _Place(tree, detail["loc"])
        if detail["type"] == "wrong":
            for below, offset, message in detail["ctx"]["parts"]:
                if message and place.reached:
                    _report_part(_Place(tree, (*detail["loc"], *below)), offset, message, faults)
                elif message:
                    faults.add(place.node.place, f"{place.key}.{place.last}", f"{message} (this is its default)")
        else:
            faults.add(place.location_for(detail["type"]), place.key, _message(detail, place, model))


class _Place:
    """A pydantic location without the parts that the document does not have (tags of unions, the list around one entry)."""

    def __init__(self, tree: Node, path: tuple[Any, ...]) -> None:
        walked = list(tree.along(path))
        self.path = tuple(key for key, _ in walked)
        self.node = walked[-1][1] if walked else tree
        self.last = str(path[-1]) if path else ""
        self.reached = bool(walked) and walked[-1][0] == (path[-1] if path else None)

    @property
    def key(self) -> str:
        return key_text(self.path)

    def location_for(self, kind: str) -> Location:
        a_word = not self.reached and isinstance(self.node.value, str)  # that stands for an entry of its name
        keys = ("extra_forbidden", "unexpected_keyword_argument", "missing")
        return self.node.place if kind in keys and not a_word else self.node.location


def key_text(path: Iterable[Any]) -> str:
    """`particles[0].ring.count`."""
    text = ""
    for key in path:
        text += f"[{key}]" if isinstance(key, int) else f".{key}" if text else str(key)
    return text


def _report_part(place: _Place, offset: int | None, message: str, faults: Faults) -> None:
    faults.add(place.node.place_of(offset), place.key, message)


def _message(detail: Any, place: _Place, model: type[BaseModel]) -> str:
    kind = detail["type"]
    if kind == "missing":
        return f"missing key {place.last!r}{_help(model, detail['loc'])}"
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        if _is_quantity(detail["loc"]):
            return _unknown_component("quantities", place.last)
        return _unknown_key(place, _keys(model, detail["loc"][:-1]))
    if kind == "not_one":
        return _not_one_component(place)
    if kind in ("list_type", "too_short"):
        return f"must be a list with one entry at least, not {shown(place.node.plain())}"
    if kind in ("model_type", "dict_type", "dataclass_type", "model_attributes_type"):
        return f"must be a mapping of keys to values, not {shown(place.node.plain())}"
    return str(detail["msg"])


def _unknown_key(place: _Place, known: list[str]) -> str:
    word = place.last
    if place.path[:1] == ("expect",) and len(place.path) == 2:
        known = expectations.names()
    elif place.path[:2] in (("sweep", "measure"), ("sweep", "stop")) and len(place.path) in (3, 4):
        known = sorted({*known, *component.names("quantities"), *component.names("diagnostics")})
    elif place.path[0] in KIND_OF_KEY and all(isinstance(step, int) for step in place.path[1:-1]) and len(place.path) > 1:
        return _unknown_component(KIND_OF_KEY[str(place.path[0])], word)
    if word.isdecimal():
        return f"unknown key {shown(word)}; a comma ends an entry, and a decimal number has a point, as 1.{word}"
    if (mark := next((each for each in "{[:" if each in word), "")) and word.split(mark)[0].strip() in known:
        wanted = "a space belongs behind the colon" if mark == ":" else f"a colon belongs before the {mark}"
        return f"unknown key {shown(word)}; {wanted}: {word.split(mark)[0].strip()}: …"
    return f"unknown key {shown(word)}{choices(word, known)}"


def _is_quantity(path: tuple[Any, ...]) -> bool:
    """Whether a pydantic location is a quantity's name, `inspect[0].y.position` or `record.table.columns[0].speed`."""
    if path[:3] == ("record", "table", "columns"):
        return len([*filter(_is_word, path)]) == 4
    return path[0] == "inspect" and path[2:3] in (("x",), ("y",), ("histogram",)) and len([*filter(_is_word, path)]) == 3


def _is_word(step: Any) -> bool:
    return not isinstance(step, int)


def _unknown_component(kind: str, word: str) -> str:
    if component.find_file(kind, word) is not None:
        return f"{word!r} acts by itself where a scene has springs: list them under springs:"
    known = [*available(kind), *([WORD] if kind in map(KIND_OF_KEY.get, KEYS) else [])]
    return f"unknown {_KIND_WORDS[kind]} {shown(word)}{choices(word, known)}"


def _not_one_component(place: _Place) -> str:
    kind = "quantities" if place.path[0] in ("inspect", "record") else KIND_OF_KEY[str(place.path[0])]
    value = place.node.value
    given = f"{len(value)} keys" if isinstance(value, dict) else shown(place.node.plain())
    told = choices(value, available(kind)) if isinstance(value, str) else f", {allowed(available(kind))}"
    return f"must be one entry, written {{name: {{parameters}}}}, not {given}{told}"


def _keys(model: Any, path: tuple[Any, ...]) -> list[str]:
    target = _descend(model, path)
    if isinstance(target, type) and issubclass(target, BaseModel):
        return list(target.model_fields)
    if dataclasses.is_dataclass(target):
        return [field.name for field in dataclasses.fields(target)]
    return []


def _help(model: Any, path: tuple[Any, ...]) -> str:
    target = _descend(model, path[:-1])
    if isinstance(target, type) and issubclass(target, BaseModel):
        described = target.model_fields[str(path[-1])].description
        return f" ({described})" if described else ""
    return ""


def _descend(annotation: Any, path: tuple[Any, ...]) -> Any:
    """The model or dataclass that pydantic's location `path` leads to, from a type."""
    options = [annotation]
    while len(options) == 1 and typing.get_origin(options[0]) not in (None, list, tuple, dict):
        origin, arguments = typing.get_origin(options[0]), typing.get_args(options[0])
        options = [arguments[0]] if origin is typing.Annotated else [each for each in arguments if each is not type(None)]
    target = options[0]
    if not path or len(options) > 1:
        return None if len(options) > 1 else target
    step, rest = path[0], path[1:]
    if typing.get_origin(target) in (list, tuple):
        return _descend(typing.get_args(target)[0], rest)
    if typing.get_origin(target) is dict:
        return _descend(typing.get_args(target)[1], rest)
    if isinstance(target, type) and issubclass(target, BaseModel) and step in target.model_fields:
        return _descend(target.model_fields[step].annotation, rest)
    if dataclasses.is_dataclass(target):
        hints = typing.get_type_hints(target)
        return _descend(hints[step], rest) if step in hints else None
    return None
