"""Object state: the numbers that Python objects of a run hold, taken out of them and put back into objects made anew.

A run has many objects that gather samples: tables, watches, diagnostics. After a break they are made again, as at the start of
the run, and `restore` then gives each attribute the value that `captured` found. An object needs no code of its own for this.

Attributes that belong to the process stay as they are in the new objects (KEPT): functions, types, open files, objects of
Taichi, and objects of the packages of BOUND, such as the simulation. So do the attributes that a class names in MADE_ANEW,
which a new object has already. Every other attribute is either captured or refused.
"""

import importlib
import io
import logging
import types
from collections import deque
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.archive.compressed import compressed, decompressed
from mpp_taichi.archive.values import KEPT, ObjectNumber
from mpp_taichi.errors import StateError

OWN = "mpp_taichi."
_BOUND = ("cli", "contacts", "device", "forces", "integrators", "scene", "simulation", "state", "step", "views", "walls")
BOUND = tuple(f"{OWN}{package}." for package in _BOUND)
# Data in these packages.
WALKED = ("Mark", "SavedFields", "SavedAccounts", "Reading", "ContactReport", "RunJudge", "RunFinding", "MasslessWatch")
# What a view remembers from picture to picture.
VIEWS = ("Renderer", "GguiView", "ViewWithPanels", "Camera", "Trails", "Appearance", "Coloring", "_Scale", "Marks")
PICTURE_MODES = ("L", "RGB")  # of pictures of PIL
_PLAIN = (type(None), bool, int, float, str, np.ndarray, np.generic)
_OF_PROCESS = (
    *(types.FunctionType, types.BuiltinFunctionType, types.MethodType, types.ModuleType, type, partial),
    *(io.IOBase, logging.Logger, Path),
)


def captured(objects: Mapping[str, Any]) -> dict[str, Any]:
    """The state of named objects, and of all objects that they hold, as a value that `values.pack` takes.

    Raises:
        TypeError: an object holds something that can neither be captured nor belongs to the process.
    """
    found = _Capture()
    roots = {name: found.value(each, name) for name, each in objects.items()}
    return {"objects": found.described, "roots": roots}


def restore(saved: Mapping[str, Any], objects: Mapping[str, Any]) -> None:
    """Put a captured state into objects of the same names and classes.

    Raises:
        StateError: the state is of other objects.
    """
    try:
        again = _Restore(saved["objects"])
        if set(saved["roots"]) != set(objects):
            raise StateError(f"the archive is of a run with {sorted(saved['roots'])}, and not with {sorted(objects)}")
        for name, each in objects.items():
            again.value(saved["roots"][name], each)
    except (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, ImportError) as error:
        raise StateError(f"the archive does not fit this run: {error!r}") from error


class _Capture:
    """Walks over objects; each object is described once."""

    def __init__(self) -> None:
        self.described: list[dict[str, Any]] = []
        self._numbers: dict[int, ObjectNumber] = {}
        self._alive: list[Any] = []  # so that no identity is used twice

    def value(self, value: Any, where: str) -> Any:
        if isinstance(value, _PLAIN):
            return value
        if isinstance(value, Mapping):
            return {self.value(key, where): self.value(each, f"{where}[{key!r}]") for key, each in value.items()}
        if isinstance(value, (list, set, frozenset)) or type(value) is tuple:
            return type(value)(self.value(each, f"{where}[…]") for each in value)
        if isinstance(value, deque):
            return deque((self.value(each, f"{where}[…]") for each in value), value.maxlen)
        if type(value).__module__ == "PIL.Image":
            return self._picture(value)
        if isinstance(value, _OF_PROCESS) or is_bound(type(value)):
            return KEPT
        if type(value).__module__.startswith(OWN):
            return self._object(value, where)
        raise TypeError(f"{where}: the archive cannot hold a {type(value).__module__}.{type(value).__qualname__}")

    def _object(self, value: Any, where: str) -> ObjectNumber:
        known = self._numbers.get(id(value))
        if known is not None:
            return known
        made = self._numbers[id(value)] = ObjectNumber(len(self.described))
        self._alive.append(value)
        entry: dict[str, Any] = {"class": _name_of(type(value)), "state": {}}
        self.described.append(entry)
        if isinstance(value, tuple):  # a NamedTuple
            entry["items"] = [self.value(each, where) for each in value]
        anew = getattr(type(value), "MADE_ANEW", ())
        attributes = {key: each for key, each in _attributes(value).items() if key not in anew}
        entry["state"] = {key: self.value(each, f"{where}.{key}") for key, each in attributes.items()}
        return made

    def _picture(self, value: Any) -> ObjectNumber:
        """A picture of PIL; plots draw on in it."""
        known = self._numbers.get(id(value))
        if known is not None:
            return known
        if value.mode not in PICTURE_MODES:
            raise TypeError(f"the archive cannot hold a picture of mode {value.mode}")
        made = self._numbers[id(value)] = ObjectNumber(len(self.described))
        self._alive.append(value)
        self.described.append({"picture": value.mode, "size": list(value.size), "data": compressed(value.tobytes())})
        return made


class _Restore:
    """Puts described objects into live objects, and makes those for which there is no live object."""

    def __init__(self, described: list[dict[str, Any]]) -> None:
        self._described = described
        self._made: dict[int, Any] = {}

    def value(self, saved: Any, live: Any) -> Any:
        """The value to be used: `live` where it could be changed to the saved value, else a new value."""
        if saved is KEPT:
            return live
        if isinstance(saved, ObjectNumber):
            return self._object(saved.number, live)
        if isinstance(saved, dict):
            found = {key: self.value(each, live.get(key) if isinstance(live, dict) else None) for key, each in saved.items()}
            return _refilled(live, found) if isinstance(live, dict) else found
        if isinstance(saved, (list, tuple, deque)):
            its = list(live) if type(live) is type(saved) and len(live) == len(saved) else [None] * len(saved)
            parts = [self.value(each, old) for each, old in zip(saved, its)]
            if isinstance(saved, deque):
                return deque(parts, saved.maxlen)
            if isinstance(saved, list) and isinstance(live, list):
                live[:] = parts
                return live
            return type(saved)(parts)
        return saved

    def _object(self, number: int, live: Any) -> Any:
        if number in self._made:
            return self._made[number]
        entry, made = self._described[number], None
        if "picture" in entry:
            self._made[number] = _picture_of(entry)
            return self._made[number]
        if "items" in entry:
            items: Any = _class_of(entry["class"])
            made = tuple.__new__(items, [self.value(each, None) for each in entry["items"]])
            self._made[number] = made
            return made
        if live is not None and _name_of(type(live)) == entry["class"]:
            made = live
        else:
            made = object.__new__(_class_of(entry["class"]))
        self._made[number] = made
        for key, saved in entry["state"].items():
            object.__setattr__(made, key, self.value(saved, getattr(made, key, None)))  # a frozen dataclass, too
        return made


def _picture_of(entry: Mapping[str, Any]) -> Any:
    from PIL import Image  # only where an archive holds pictures

    (width, height), mode = (int(side) for side in entry["size"]), entry["picture"]
    if mode not in PICTURE_MODES or min(width, height) < 1:
        raise ValueError(f"a picture of mode {mode}, {width} x {height}")
    return Image.frombytes(mode, (width, height), decompressed(entry["data"], width * height * len(mode)))


def is_bound(cls: type) -> bool:
    """Whether objects of a class belong to the process: they are made anew, with the run."""
    module = cls.__module__
    return module.startswith("taichi") or (module.startswith(BOUND) and cls.__name__ not in (*WALKED, *VIEWS))


def _attributes(value: Any) -> dict[str, Any]:
    if hasattr(value, "__dict__"):
        return dict(vars(value))
    return {name: getattr(value, name) for cls in type(value).__mro__ for name in getattr(cls, "__slots__", ())}


def _refilled(live: dict, found: dict) -> dict:
    live.clear()
    live.update(found)
    return live


def _name_of(cls: type) -> str:
    return f"{cls.__module__}:{cls.__qualname__}"


def _class_of(name: str) -> type:
    """A class of this program; nothing else is imported, whatever an archive names."""
    module, _, path = name.partition(":")
    if not module.startswith(OWN) or not path.replace("_", "").isalnum():
        raise StateError(f"the archive names {name!r}, which is no class of this program")
    found = getattr(importlib.import_module(module), path)
    if not isinstance(found, type) or found.__module__ != module or is_bound(found):
        raise StateError(f"the archive names {name!r}, which holds no samples")
    return found
