"""Switch: the parts of fast_taichi that are in use in this process, and the parts that are off, with the reasons."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mpp_taichi.errors import ArgumentError

VARIABLE = "MPP_TAICHI_FAST"
KNOWN_TAICHI = (1, 7, 4)  # the version whose internals the parts were written for
NAMES = (
    "source_cache",
    "launch_cache",
    "serial_loops",
    "worker_threads",
    "quick_compilation",
    "short_compilation",
    "explicit_vectors",
    "lane_arithmetic",
    "prefetch",
    "spring_lanes",
    "series_walk",
    "large_pages",
)


@dataclass
class _Parts:
    """The parts in use: none before `install`. `off` are the parts that were left out, and `reason` says why."""

    in_use: set[str] = field(default_factory=set)
    off: tuple[str, ...] = ()
    reason: str = ""
    decided: bool = False


_parts = _Parts()  # A process has one Taichi, so each part is on or off for the whole process.


def is_on(name: str) -> bool:
    """Whether a part is in use; before `install` none is."""
    return name in _parts.in_use


def is_wanted(name: str) -> bool:
    """Whether the environment variable leaves a part on, for a part that works while Taichi is imported.

    Raises:
        ArgumentError: the variable has a name that no part has.
    """
    return name not in parts_off(variable(), KNOWN_TAICHI)[0]


def is_decided() -> bool:
    """Whether this process has decided which parts are in use."""
    return _parts.decided


def variable() -> str:
    """The value of the environment variable; empty where it is not set."""
    return os.environ.get(VARIABLE, "")


def check_variable() -> None:
    """Raise ArgumentError where the environment variable has a name that no part has; Taichi is not imported."""
    parts_off(variable(), KNOWN_TAICHI)


def parts_off(text: str, version: tuple[int, ...]) -> tuple[tuple[str, ...], str]:
    """The parts that a value of the variable and a version of Taichi turn off, and the reason.

    Raises:
        ArgumentError: the value has a name that no part has.
    """
    wanted = [name for name in (part.strip() for part in text.split(",")) if name]
    unknown = [name for name in wanted if name not in NAMES]
    everything = wanted == ["off"]
    if unknown and not everything:
        raise ArgumentError(
            f"{VARIABLE}={text}: {unknown[0]!r} is unknown, allowed: off, or names separated by commas of {', '.join(NAMES)}"
        )
    if tuple(version) != KNOWN_TAICHI:
        found, known = (".".join(map(str, numbers)) for numbers in (version, KNOWN_TAICHI))
        return NAMES, f"this is Taichi {found}, and they are made for {known}"
    off = NAMES if everything else tuple(name for name in NAMES if name in wanted)
    return off, f"{VARIABLE}={text}" if off else ""


def decide(text: str, version: tuple[int, ...]) -> set[str]:
    """Settle for the whole process which parts are in use, and return their names."""
    _parts.off, _parts.reason = parts_off(text, version)
    _parts.in_use = set(NAMES).difference(_parts.off)
    _parts.decided = True
    return _parts.in_use


def facts() -> dict[str, Any]:
    """The entries of reports about parts that are off; empty where all are on."""
    return {"fast_taichi_off": list(_parts.off), "fast_taichi_reason": _parts.reason} if _parts.off else {}


def line(found: Mapping[str, Any]) -> str:
    """The parts that are off, as a text for a person; empty where all are on."""
    if not found.get("fast_taichi_off"):
        return ""
    names = "all" if len(found["fast_taichi_off"]) == len(NAMES) else ", ".join(found["fast_taichi_off"])
    return f"{names} of fast_taichi ({found['fast_taichi_reason']})"
