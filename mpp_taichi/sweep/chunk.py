"""Chunk: the rows of some members in a file, written whole under a name that is a digest of all that they depend on."""

import hashlib
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.sweep.member import STATUSES, MemberRow

DIGITS = 24  # of the digest in a name
SUFFIX = ".npz"


@dataclass(frozen=True, eq=False)
class Columns:
    """Rows as columns: values (rows, measures); the other columns (rows,)."""

    number: np.ndarray
    status: np.ndarray
    values: np.ndarray
    time: np.ndarray
    steps: np.ndarray
    particle: np.ndarray
    reason: np.ndarray


def name_of(known: str, values: Sequence[Mapping[str, Any]], numbers: Sequence[int]) -> str:
    """The name of a chunk of these members; `known` is the text of what all results of the sweep depend on."""
    text = f"[{known}, {plain_text(list(values))}, {plain_text(list(numbers))}]"
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS] + SUFFIX


def plain_text(value: Any) -> str:
    """Plain values as a text that is the same for equal values."""
    return json.dumps(value, sort_keys=True, default=str)


def columns_of(rows: Sequence[MemberRow], measures: int) -> Columns:
    """The columns; a member without values, which was refused, has NaN."""
    values = np.full((len(rows), measures), np.nan)
    for k, row in enumerate(rows):
        values[k, : len(row.values)] = row.values
    return Columns(
        number=np.array([row.number for row in rows], np.int64),
        status=np.array([STATUSES.index(row.status) for row in rows], np.int8),
        values=values,
        time=np.array([row.time for row in rows]),
        steps=np.array([row.steps for row in rows], np.int64),
        particle=np.array([row.particle for row in rows], np.int32),
        reason=np.array([row.reason for row in rows], np.str_),
    )


def write(path: Path, columns: Columns) -> None:
    """Write a chunk.

    Raises:
        OutputError: it cannot be written.
    """
    with whole_file(path, "a chunk of the sweep", durable=True, shared=True) as temporary:
        np.savez(temporary, **vars(columns))


def read(path: Path, numbers: np.ndarray, measures: int) -> Columns | None:
    """A chunk of these members; None where there is none, or where the file is not sound."""
    try:
        with np.load(path, allow_pickle=False) as found:
            columns = Columns(**{name: found[name] for name in Columns.__dataclass_fields__})
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    shapes = all(len(each) == len(numbers) for each in vars(columns).values())
    sound = shapes and columns.values.shape == (len(numbers), measures) and np.array_equal(columns.number, numbers)
    return columns if sound else None
