"""Colouring: particles and springs in the colours of a quantity, and the legend that relates colours to numbers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields

import numpy as np

from mpp_taichi.scene.human_units import unit_of
from mpp_taichi.scene.view_spec import ColorBySpec, ColorScaleSpec, GroupColorsSpec, SpringColorBySpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.color_maps import GROUP_COLORS, colors_of

_Values = np.ndarray | None


@dataclass(frozen=True)
class ColorBar:
    """One scale of a legend: the colours of a map from `low` to `high`."""

    label: str
    map: str
    low: float
    high: float
    logarithmic: bool = False


@dataclass(frozen=True, eq=False)
class GroupKey:
    """One legend of groups, or of kinds of arrows: names and their colours, shape (count, 3)."""

    names: tuple[str, ...]
    colors: np.ndarray
    label: str = "groups"


def _speed(frame: Frame) -> _Values:
    return None if frame.velocity is None else np.linalg.norm(frame.velocity, axis=1)


def _kinetic_energy(frame: Frame) -> _Values:
    if frame.velocity is None or frame.mass is None:
        return None
    return 0.5 * frame.mass * np.einsum("ij,ij->i", frame.velocity, frame.velocity)


def _spring_length(frame: Frame) -> np.ndarray:
    between = np.asarray(frame.between, dtype=np.int64)
    separation = frame.position[between[:, 1]] - frame.position[between[:, 0]]
    return np.asarray(np.linalg.norm(separation, axis=1))


def _strain(frame: Frame) -> _Values:
    if frame.rest_length is None:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):  # a spring without a length has no strain
        return np.asarray((_spring_length(frame) - frame.rest_length) / frame.rest_length)


def _tension(frame: Frame) -> _Values:
    if frame.rest_length is None or frame.stiffness is None:
        return None
    with np.errstate(invalid="ignore"):  # the stiffness of a rod is infinite
        return np.asarray(frame.stiffness * (_spring_length(frame) - frame.rest_length))


PARTICLE_QUANTITIES: dict[str, Callable[[Frame], _Values]] = {
    "speed": _speed,
    "kinetic_energy": _kinetic_energy,
    "mass": lambda frame: frame.mass,
    "charge": lambda frame: frame.charge,
    "radius": lambda frame: frame.radius,
    "x": lambda frame: frame.position[:, 0],
    "y": lambda frame: frame.position[:, 1],
    "z": lambda frame: frame.position[:, 2],
    "index": lambda frame: np.arange(len(frame.position), dtype=float),
}
"""Values of all particles of a frame; None where the frame does not hold the quantity."""
DIMENSIONS = {  # powers of length, time and mass, of the quantities that are no pure numbers
    "speed": (1, -1, 0),
    "kinetic_energy": (2, -2, 1),
    "mass": (0, 0, 1),
    **dict.fromkeys(("radius", "x", "y", "z", "length"), (1, 0, 0)),
    "tension": (1, -2, 1),
}
SPRING_QUANTITIES: dict[str, Callable[[Frame], _Values]] = {"strain": _strain, "tension": _tension, "length": _spring_length}
SIGNED = ("strain", "tension")  # quantities whose zero must be visible


class Coloring:
    """Colours by quantities. A range that the scene does not give is the range of all frames so far, so it only grows."""

    def __init__(self, particles: ColorBySpec | None, springs: SpringColorBySpec | None) -> None:
        """Find the quantities that the view asks for."""
        self._groups: GroupColorsSpec | None = particles.group if particles is not None else None
        self._particles = _chosen(particles, PARTICLE_QUANTITIES)
        self._springs = _chosen(springs, SPRING_QUANTITIES)
        self._units: Mapping[str, str] | None = None

    def particle_colors(self, frame: Frame) -> np.ndarray | None:
        """Colours of the particles as displayed, shape (particle_count, 3); None where no quantity is asked for, or known."""
        if self._groups is not None:
            colors = np.array(frame.color, dtype=float)
            for number, (_, first, count) in enumerate(self._groups.of):
                colors[first : first + count] = GROUP_COLORS[number % len(GROUP_COLORS)]
            return colors
        if self._particles is None:
            return None
        self._units = frame.units
        seen = np.isfinite(frame.position).all(axis=1)
        return self._particles.colors(PARTICLE_QUANTITIES[self._particles.name](frame), seen)

    def spring_colors(self, frame: Frame) -> np.ndarray | None:
        """Colours of the springs as displayed, shape (spring_count, 3), or None as for the particles; rods keep their own."""
        if self._springs is None:
            return None
        self._units = frame.units
        elastic = np.ones(len(frame.between), bool) if frame.stiffness is None else np.isfinite(frame.stiffness)
        found = self._springs.colors(SPRING_QUANTITIES[self._springs.name](frame), elastic)
        return found if found is None or elastic.all() else np.where(elastic[:, None], found, frame.spring_color)

    def legend(self) -> list[ColorBar | GroupKey]:
        """The legend of the colours, for the frames so far."""
        entries: list[ColorBar | GroupKey] = []
        if self._groups is not None:
            names = tuple(name for name, _, _ in self._groups.of)
            entries.append(GroupKey(names, GROUP_COLORS[np.arange(len(names)) % len(GROUP_COLORS)]))
        return entries + [
            bar for scale in (self._particles, self._springs) if scale is not None and (bar := scale.bar(self._units))
        ]


class _Scale:
    """The scale of one quantity: its range, which may grow, and its colours."""

    def __init__(self, name: str, spec: ColorScaleSpec) -> None:
        self.name, self.spec = name, spec
        self.map = spec.map or ("diverging" if name in SIGNED else "viridis")
        self.low, self.high = spec.range or (np.inf, -np.inf)

    def colors(self, values: _Values, seen: np.ndarray) -> np.ndarray | None:
        """Colours of values; a range that the scene does not give takes in the values of visible particles."""
        if values is None:
            return None
        values = np.asarray(values, dtype=float)
        if self.spec.range is None:
            self._widen(values[seen & np.isfinite(values) & ((values > 0.0) | (not self.spec.logarithmic))])
        if self.spec.logarithmic:
            values = np.log(np.where(values > 0.0, values, np.nan))
            low, high = (np.log(self.low), np.log(self.high)) if self.low > 0.0 else (0.0, 0.0)
        else:
            low, high = self.low, self.high
        if not (np.isfinite(low) and high > low):
            return colors_of(np.where(np.isfinite(values), 0.5, np.nan), self.map)  # all alike: the middle of the map
        with np.errstate(over="ignore"):
            return colors_of((values - low) / (high - low), self.map)

    def _widen(self, values: np.ndarray) -> None:
        if len(values) == 0:
            return
        self.low, self.high = min(self.low, float(values.min())), max(self.high, float(values.max()))
        if self.map == "diverging" and not self.spec.logarithmic:  # zero is the neutral colour
            self.high = max(self.high, -self.low)
            self.low = -self.high

    def bar(self, units: Mapping[str, str] | None) -> ColorBar | None:
        """The entry of the scale in the legend, once there are values: `speed [AU/day]`, unless the scene has a text for it."""
        if not self.low <= self.high:
            return None
        unit = unit_of(units, DIMENSIONS.get(self.name, (0, 0, 0)))
        label = self.spec.label or self.name.replace("_", " ") + (f" [{unit}]" if unit else "")
        return ColorBar(label, self.map, self.low, self.high, self.spec.logarithmic)


def _chosen(spec: ColorBySpec | SpringColorBySpec | None, quantities: dict[str, Callable[[Frame], _Values]]) -> _Scale | None:
    """The scale of the quantity that the view asks for."""
    for each in fields(spec) if spec is not None else ():
        if each.name in quantities and getattr(spec, each.name) is not None:
            return _Scale(each.name, getattr(spec, each.name))
    return None
