"""The keys in which two plain values differ, such as the scenes of two runs."""

from collections.abc import Callable, Mapping
from typing import Any


def differences(old: Any, new: Any, path: str = "") -> list[str]:
    """The keys in which two plain values differ, each with both values."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        keys = dict.fromkeys((*old, *new))
        return [line for key in keys for line in differences(old.get(key), new.get(key), f"{path}.{key}" if path else str(key))]
    if isinstance(old, (list, tuple)) and isinstance(new, (list, tuple)) and len(old) == len(new):
        return [line for k, pair in enumerate(zip(old, new)) for line in differences(*pair, f"{path}[{k}]")]
    same: Callable[[Any, Any], bool] = lambda a, b: a == b or (a != a and b != b)  # noqa: E731 - NaN is the same as NaN
    return [] if same(old, new) else [f"{path}: {_short(old)} there, {_short(new)} here"]


def _short(value: Any) -> str:
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 40 else f"{text[:37]}…"
