"""Values: nested numbers, texts and arrays as bytes and back, without Python's pickle.

A file of this program may come from anyone, so reading it must not be able to run code. The bytes are the length of a JSON
text (8 bytes, little-endian), the JSON text, and the data of all arrays one after the other. The JSON text holds the value, and
under "arrays" the number type and the shape of each array. Forms that JSON does not have are objects with the key "!":

    {"!": "array", "v": k}      array k                 {"!": "scalar", "v": k}   a NumPy number, as array k of shape ()
    {"!": "tuple", "v": […]}    a tuple                 {"!": "set", "v": […]}    a set
    {"!": "deque", "v": […], "n": m}                    a deque of at most m entries
    {"!": "dict", "v": [[key, value], …]}               a dictionary whose keys are not all plain texts
    {"!": "number", "v": k}     an ObjectNumber         {"!": "kept"}             KEPT
"""

import json
import math
import re
import struct
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.errors import StateError

LENGTH = struct.Struct("<Q")
KINDS = "biufcUS"  # kinds of NumPy number types that are kept: none of them can hold an object
TYPE = re.compile(r"[<>|][biufcUS]\d{1,6}")  # what NumPy calls them; other texts could be types of many parts, or code


@dataclass(frozen=True)
class ObjectNumber:
    """The number of an object that is described elsewhere in the value."""

    number: int


class _Kept:
    """The type of `KEPT`."""


KEPT = _Kept()
"""Stands for a part that the reader of a value has itself, and keeps."""


def pack(value: Any) -> bytes:
    """The bytes of a value.

    Raises:
        TypeError: a part of it is none of the forms above.
    """
    arrays: list[np.ndarray] = []
    form = _form(value, arrays)
    table = [[array.dtype.str, list(array.shape)] for array in arrays]
    text = json.dumps({"value": form, "arrays": table}, separators=(",", ":")).encode()
    return b"".join([LENGTH.pack(len(text)), text, *(np.ascontiguousarray(array).tobytes() for array in arrays)])


def unpack(data: bytes) -> Any:
    """The value of bytes that `pack` made.

    Raises:
        StateError: the bytes are damaged.
    """
    try:
        (length,) = LENGTH.unpack_from(data)
        text = json.loads(data[LENGTH.size : LENGTH.size + length])
        arrays, place = [], LENGTH.size + length
        for name, shape in text["arrays"]:
            if not TYPE.fullmatch(name) or any(type(side) is not int or side < 0 for side in shape):
                raise ValueError(f"an array of {name} of shape {shape}")
            kind, count = np.dtype(name), math.prod(shape)
            if count * kind.itemsize > len(data) - place:
                raise ValueError(f"an array of shape {shape}, whose numbers are not there")
            arrays.append(np.frombuffer(data, kind, count, place).reshape(shape).copy())
            place += count * kind.itemsize
        if place != len(data):
            raise ValueError(f"{len(data) - place} bytes too many")
        return _value(text["value"], arrays)
    except (struct.error, ValueError, KeyError, TypeError, IndexError, OverflowError, RecursionError) as error:
        raise StateError(f"a record is damaged: {error}") from error


def _form(value: Any, arrays: list[np.ndarray]) -> Any:
    if value is None or isinstance(value, (bool, str)) or type(value) in (int, float):
        return value
    if isinstance(value, (np.ndarray, np.generic)):
        array = np.asarray(value)
        if array.dtype.kind not in KINDS:
            raise TypeError(f"an array of {array.dtype} cannot be kept")
        arrays.append(array)
        return {"!": "array" if isinstance(value, np.ndarray) else "scalar", "v": len(arrays) - 1}
    if isinstance(value, list):
        return [_form(each, arrays) for each in value]
    if isinstance(value, Mapping):
        if all(type(key) is str and key != "!" for key in value):
            return {key: _form(each, arrays) for key, each in value.items()}
        return {"!": "dict", "v": [[_form(key, arrays), _form(each, arrays)] for key, each in value.items()]}
    if isinstance(value, deque):
        return {"!": "deque", "v": [_form(each, arrays) for each in value], "n": value.maxlen}
    if isinstance(value, (tuple, set, frozenset)):
        name = "tuple" if isinstance(value, tuple) else "set"
        return {"!": name, "v": [_form(each, arrays) for each in value]}
    if isinstance(value, ObjectNumber):
        return {"!": "number", "v": value.number}
    if value is KEPT:
        return {"!": "kept"}
    raise TypeError(f"a {type(value).__name__} cannot be kept")


def _value(form: Any, arrays: list[np.ndarray]) -> Any:
    if isinstance(form, list):
        return [_value(each, arrays) for each in form]
    if not isinstance(form, dict):
        return form
    if "!" not in form:
        return {key: _value(each, arrays) for key, each in form.items()}
    kind, inside = form["!"], form.get("v", ())
    if kind in ("array", "scalar"):
        return arrays[inside] if kind == "array" else arrays[inside][()]
    if kind == "number":
        return ObjectNumber(int(inside))
    if kind == "kept":
        return KEPT
    if kind == "dict":
        return {_value(key, arrays): _value(each, arrays) for key, each in inside}
    parts = [_value(each, arrays) for each in inside]
    if kind == "deque":
        return deque(parts, form["n"])
    if kind not in ("tuple", "set"):
        raise ValueError(f"an unknown form {kind!r}")
    return tuple(parts) if kind == "tuple" else set(parts)
