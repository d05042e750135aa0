"""The settings of a window that are kept from one run to the next."""

from collections.abc import Container
from dataclasses import dataclass, fields, replace
from typing import Any

from mpp_taichi.views.looks import LOOKS
from mpp_taichi.views.pace import FASTEST, SLOWEST
from mpp_taichi.views.window_place import LEAST

MOST_PIXELS = 1 << 15  # of a screen, with its neighbours


@dataclass
class WindowSettings:
    """What the user has changed in a window; None for what was never changed.

    look     one of LOOKS
    size     width and height in pixels; `place` of the upper left corner on the screen
    panels, trails   whether they are shown, in scenes that leave this open
    speed    powers of two by which a run is faster than its scene asks
    """

    look: str | None = None
    size: tuple[int, int] | None = None
    place: tuple[int, int] | None = None
    panels: bool | None = None
    trails: bool | None = None
    speed: int | None = None

    @staticmethod
    def of(content: Any) -> "WindowSettings":
        """The settings that a mapping from a file holds.

        Raises:
            ValueError: it holds something else.
        """
        if not isinstance(content, dict):
            raise ValueError("it is no mapping")
        checks = {
            "look": lambda value: value in LOOKS,
            "size": lambda value: _is_pair(value, LEAST, (MOST_PIXELS, MOST_PIXELS)),
            "place": lambda value: _is_pair(value, (-MOST_PIXELS, -MOST_PIXELS), (MOST_PIXELS, MOST_PIXELS)),
            "panels": lambda value: isinstance(value, bool),
            "trails": lambda value: isinstance(value, bool),
            "speed": lambda value: _is_whole(value, SLOWEST, FASTEST),
        }
        for key, value in content.items():
            if key not in checks:
                raise ValueError(f"unknown key {str(key)[:40]!r}, allowed: {', '.join(checks)}")
            if not checks[key](value):
                raise ValueError(f"{key} cannot be {str(value)[:40]!r}")
        known: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in content.items()}
        return WindowSettings(**known)

    def as_mapping(self) -> dict[str, Any]:
        """The content of a file that holds these settings."""
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        return {key: list(value) if isinstance(value, tuple) else value for key, value in given.items() if value is not None}


class KeptChanges:
    """Gives a window the settings that are left open, and gives the settings the changes that the user makes."""

    def __init__(self, settings: WindowSettings, decided: Container[str], *, look_decided: bool) -> None:
        """`decided` are the settings that the scene decides, with `look_decided` also the look."""
        self._settings = settings
        self._decided = {each.name for each in fields(settings) if each.name in decided} | ({"look"} if look_decided else set())
        self._seen: WindowSettings | None = None

    def begin(self, name: str) -> Any:
        """A setting with which the window begins; None where it is decided, or was never changed."""
        return None if name in self._decided else getattr(self._settings, name)

    def see(self, now: WindowSettings) -> None:
        """Take every setting that has changed since the last call in which it was not None."""
        before = self._seen
        self._seen = replace(before or now, **{key: value for key, value in vars(now).items() if value is not None})
        for key, value in vars(now).items():
            if before is not None and value is not None and value != getattr(before, key) and key not in self._decided:
                setattr(self._settings, key, value)


def _is_whole(value: Any, least: int, most: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def _is_pair(value: Any, least: tuple[int, int], most: tuple[int, int]) -> bool:
    is_pair = isinstance(value, (list, tuple)) and len(value) == 2
    return is_pair and all(_is_whole(*each) for each in zip(value, least, most, strict=True))
