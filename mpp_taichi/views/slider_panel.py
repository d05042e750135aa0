"""Sliders in a window: the text beside each slider, and the value at each of its places. `Paper` only draws the sliders.

A range is scaled by a power of ten, or to its decimal logarithm.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

DIGITS = 6  # digits of a value that is set by hand
WIDTH, ROW, HEAD = 288, 23, 32  # pixels: of the panel, of a slider in it, and of its title with the rim


@dataclass(frozen=True)
class Knob:
    """A parameter from `low` to `high`; `read` returns its present value. `keys` lead to both ends while they are held."""

    path: str
    label: str
    low: float
    high: float
    logarithmic: bool
    read: Callable[[], float]
    keys: tuple[str, ...] = ()

    @property
    def unit(self) -> float:
        """The value of 1 on a linear slider: a power of ten for which three decimals are enough."""
        decade = math.floor(math.log10(max(abs(self.low), abs(self.high))))
        return 1.0 if -1 <= decade <= 4 else 10.0**decade

    def place(self, value: float) -> float:
        """The place of the slider at a value."""
        value = min(max(value, self.low), self.high)
        return math.log10(value) if self.logarithmic else value / self.unit

    def value(self, place: float) -> float:
        """The value at a place, rounded to the digits that a hand can set, and within the range."""
        value = 10.0**place if self.logarithmic else place * self.unit
        return min(max(float(f"{value:.{DIGITS}g}"), self.low), self.high)

    @property
    def text(self) -> str:
        """The text beside the slider. GGUI identifies the slider by the part after ###, while the text before it changes."""
        scale = "  [log10]" if self.logarithmic else "" if self.unit == 1.0 else f"  [{self.unit:.0e}]"
        keys = f"  ({', '.join(self.keys).upper()})" if self.keys else ""
        return f"{self.label} = {self.read():.4g}{scale}{keys}###{self.path}"


class SliderGui(Protocol):
    """The functions of GGUI's panel that the sliders use."""

    def slider_float(self, text: str, old_value: float, minimum: float, maximum: float) -> float:
        """Draw a slider, and return its place."""


class SliderPanel:
    """All sliders of a scene; `shown` is toggled by the user."""

    def __init__(self, knobs: Sequence[Knob]) -> None:
        """The sliders are shown where the scene has sliders."""
        self.knobs = tuple(knobs)
        self.shown = bool(self.knobs)

    def toggle(self) -> None:
        """Show or hide the sliders."""
        self.shown = bool(self.knobs) and not self.shown

    def box(self, size: tuple[int, int], top: int) -> tuple[float, float, float, float]:
        """Left, top, width and height of the panel as shares of the window, below `top` pixels."""
        width, height = min(WIDTH, size[0] - 16), ROW * len(self.knobs) + HEAD
        return 8 / size[0], top / size[1], width / size[0], height / size[1]

    def draw(self, gui: SliderGui) -> dict[str, float]:
        """Put the sliders into a window of GGUI; returns the parameters that were moved, with their new values."""
        moved = {}
        for knob in self.knobs:
            place = float(np.float32(knob.place(knob.read())))
            ends = knob.place(knob.low), knob.place(knob.high)
            now = float(gui.slider_float(knob.text, place, *ends))
            if now != place and (value := knob.value(now)) != knob.read():
                moved[knob.path] = value
        return moved
