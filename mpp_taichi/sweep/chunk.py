"""Chunk: the rows of some members in a file, written whole under a name that is a digest of all that they depend on."""

import hashlib
import json
import os
import secrets
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.atomic_file import reason
from mpp_taichi.errors import OutputError
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
    write_whole(path, lambda stream: np.savez(stream, **vars(columns)), "a chunk of the sweep")


def write_whole(path: Path, fill: Callable[[Any], object], what: str) -> None:
    """Write a file whole: under a name of this process and this moment, onto the disk, and then under its name.

    So several processes may write the same file at the same time.

    Raises:
        OutputError: it cannot be written; says `what` was to be in it.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.{secrets.token_hex(4)}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(temporary, "xb") as stream:
            fill(stream)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
        _sync_folder(path.parent)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise OutputError(f"{path}: cannot write {what}: {reason(error)}") from error


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


def _sync_folder(folder: Path) -> None:
    """Put the new name onto the disk too, where the system lets a folder be synchronised."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(descriptor)
    except OSError:
        pass
    finally:
        os.close(descriptor)
