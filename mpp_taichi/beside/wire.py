"""Wire: words and arrays between two processes of this program, through a pipe.

A message is a line of JSON, which lists the arrays, and then their bytes.
"""

import json
from collections.abc import Mapping
from typing import IO, Any

import numpy as np

Message = tuple[dict[str, Any], dict[str, np.ndarray]]


def send(stream: IO[bytes], words: Mapping[str, Any], arrays: Mapping[str, np.ndarray] | None = None) -> None:
    """Write a message; `words` holds values that JSON knows."""
    given = {name: np.ascontiguousarray(array) for name, array in (arrays or {}).items()}
    heads = [[name, array.dtype.str, array.shape] for name, array in given.items()]
    stream.write(json.dumps({"words": words, "arrays": heads}).encode() + b"\n")
    for array in given.values():
        stream.write(array.tobytes())
    stream.flush()


def receive(stream: IO[bytes]) -> Message | None:
    """Read a message; None where the other end is closed, even within a message, or sends no message of this form."""
    try:
        head = json.loads(stream.readline())
    except ValueError:
        return None
    arrays = {}
    for name, kind, shape in head["arrays"]:
        size = np.dtype(kind).itemsize * int(np.prod(shape, dtype=np.int64))
        data = stream.read(size)
        if len(data) < size:
            return None
        arrays[name] = np.frombuffer(data, np.dtype(kind)).reshape(shape)
    return head["words"], arrays
