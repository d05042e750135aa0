"""Carried: the passport that the files of a run get as they are finished."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from mpp_taichi.passport.formats import FORMATS

_present: ContextVar[Mapping[str, Any] | None] = ContextVar("passport", default=None)


@contextmanager
def carrying(facts: Mapping[str, Any]) -> Iterator[None]:
    """A block in which every finished file gets these facts, as plain data, where its format has room for them."""
    token = _present.set(facts)
    try:
        yield
    finally:
        _present.reset(token)


def stamp(path: Path, suffix: str | None = None) -> None:
    """Put the passport into a finished file; nothing is done outside of `carrying`, or for a format without room.

    suffix   of the format, where the path still has another suffix

    Raises:
        OSError: the file cannot be written.
    """
    facts, kind = _present.get(), FORMATS.get((suffix or path.suffix).lower())
    if facts is not None and kind is not None:
        kind.put(path, facts)
