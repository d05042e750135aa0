"""Units for readers: times and lengths of a scene in the unit in which their numbers are easy to read.

1,668,000 s are shown as 19.3 d. The scene's own unit stays where its numbers are easy to read already.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from mpp_taichi.scene.units import LENGTHS, TIMES

SYMBOLS = {"us": "µs", "hour": "h", "day": "d", "um": "µm"}
SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
EASY = (1.0, 1000.0)  # the length of a run in its own unit that needs no other unit: from … up to
LEAST_TIME = 2.0  # of a chosen unit, the length of a run
EASY_LENGTHS = (0.01, 10_000.0)
LEAST_LENGTH = 0.5  # of a chosen unit
METRIC = ("nm", "um", "mm", "m", "km", "AU", "pc", "kpc")  # lengths that are chosen in place of the scene's unit
PLAIN = (1e-3, 1e5)  # numbers without a power of ten: from … up to
READINGS = 100.0  # a time scale has between so many and ten times so many readings in a run


def symbol(unit: str) -> str:
    """The sign of a unit in pictures and texts."""
    return SYMBOLS.get(unit, unit)


def unit_of(units: Mapping[str, str] | None, dimension: tuple[int, int, int]) -> str:
    """`AU/day`, `Msun AU²/day²`, from powers of length, time and mass; empty for pure numbers, and without units."""
    if units is None:
        return ""
    names = tuple(units[each] for each in ("length", "time", "mass"))
    parts = [(name, power) for name, power in zip(names, dimension) if power]
    above, below = ([_power(name, abs(power)) for name, power in parts if power * sign > 0] for sign in (1, -1))
    return "/".join([" ".join(reversed(above)) or "1", *below]) if parts else ""


def _power(name: str, power: int) -> str:
    return name if power == 1 else name + str(power).translate(SUPERSCRIPTS)


@dataclass(frozen=True)
class TimeScale:
    """How the times of one run are written: the unit, its size in units of the scene, and the number of decimals.

    `power` is a power of ten that is taken out of times without a unit: 1,668,000 is written as 1.67e6.
    """

    unit: str = ""
    size: float = 1.0
    decimals: int | None = None
    power: int = 0

    @staticmethod
    def of(units: Mapping[str, str] | None, end: float) -> "TimeScale":
        """The scale of a run until the time `end`; all its readings have the same unit and the same number of decimals."""
        if not (end > 0.0 and math.isfinite(end)):
            return TimeScale(symbol(units["time"]) if units else "")
        unit, size = ("", 1.0) if units is None else _time_unit(units["time"], end)
        power = 0 if PLAIN[0] <= end / size < PLAIN[1] else math.floor(math.log10(end / size) + 1e-9)
        finest = math.log10(end / size / READINGS) - power
        return TimeScale(symbol(unit), size, max(0, math.ceil(-finest - 1e-9)), power)

    def text(self, time: float) -> str:
        """`19.3 d`."""
        value = time / self.size / 10.0**self.power
        number = f"{value:.4g}" if self.decimals is None else f"{value:.{self.decimals}f}"
        if float(number) == 0.0:
            number = number.removeprefix("-")
        number += f"e{self.power}" if self.power else ""
        return f"{number} {self.unit}" if self.unit else number


def _time_unit(own: str, end: float) -> tuple[str, float]:
    """The name of the unit, and its size in units of the scene."""
    if EASY[0] <= end < EASY[1]:
        return own, 1.0
    seconds = end * TIMES[own]
    known = sorted(TIMES, key=TIMES.__getitem__)
    fitting = [name for name in known if seconds >= LEAST_TIME * TIMES[name]] or known[:1]
    return fitting[-1], TIMES[fitting[-1]] / TIMES[own]


def time_text(units: Mapping[str, str] | None, time: float) -> str:
    """One time by itself, `19.3 d`; empty where the scene's own unit is easy to read, or the scene has no units."""
    if units is None or not math.isfinite(time):
        return ""
    scale = TimeScale.of(units, abs(time))
    return "" if scale.size == 1.0 else scale.text(time)


def length_units(units: Mapping[str, str] | None) -> list[tuple[str, float]]:
    """Signs of lengths, with their sizes in lengths of the scene: the scene's own unit, then all to choose from, by size."""
    if units is None:
        return [("", 1.0)]
    own = units["length"]
    return [(symbol(own), 1.0), *((symbol(name), LENGTHS[name] / LENGTHS[own]) for name in METRIC)]


def length_unit(units: Mapping[str, str] | None, length: float) -> tuple[str, float]:
    """The sign of the unit in which a length is easy to read, and the size of the unit in lengths of the scene."""
    own, *others = length_units(units)
    if EASY_LENGTHS[0] <= length < EASY_LENGTHS[1] or not others:
        return own
    return next((each for each in reversed(others) if length >= LEAST_LENGTH * each[1]), others[0])
