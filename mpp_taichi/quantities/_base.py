"""What every quantity is: a number that can be read off a run at any moment, and is then plotted against another."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from mpp_taichi.component import Particles
from mpp_taichi.diagnostics._at_end import rows
from mpp_taichi.diagnostics._base import NoResultError
from mpp_taichi.energy.mechanics import mean_by_mass
from mpp_taichi.scene.layout import ParticleLayout, layout_of
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

__all__ = ["Dimension", "Look", "NoResultError", "OfEach", "Quantity", "Setting", "component_of", "center_of", "rows"]
Dimension = tuple[int, int, int]
"""Powers of length, time and mass."""
ENERGY: Dimension = (2, -2, 1)
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


class Look(Protocol):
    """A run at one moment; what costs something is computed when it is first asked for."""

    phase_number: int
    phase_energy: float | None

    @property
    def time(self) -> float:
        """Simulated time."""

    @property
    def snapshot(self) -> Snapshot:
        """The particles."""

    @property
    def potential_energy(self) -> float:
        """Of all forces that have one."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What a quantity may know of its scene beforehand: the scene, its start, and what its particles are called."""

    spec: SceneSpec
    start: Snapshot

    @cached_property
    def layout(self) -> ParticleLayout:
        """Where each entry's particles begin."""
        return layout_of(self.spec)

    def name_of(self, of: Particles | int | None) -> str:
        """`planet`, `sheet[27]`, `particle 30`, the name of a group or `sheet[8:16]`; of all particles nothing."""
        if of is None:
            return ""
        first, count = (of, 1) if isinstance(of, int) else of
        number = self.layout.entry_of(first)
        name, whole = self.layout.entries[number].parameters.get("name"), self.layout.counts[number]
        if count == whole:
            return name or (f"particle {first}" if count == 1 else self.layout.entries[number].name)
        offset = first - self.layout.starts[number]
        if count > 1:
            return f"{name or self.layout.entries[number].name}[{offset}:{offset + count}]"
        return f"{name}[{offset}]" if name else f"particle {first}"

    def unit(self, dimension: Dimension) -> str:
        """`AU/day`, `Msun AU²/day²`; empty for pure numbers, and where the scene names no units."""
        if self.spec.units is None:
            return ""
        names = tuple(self.spec.units[each] for each in ("length", "time", "mass"))
        parts = [(name, power) for name, power in zip(names, dimension) if power]
        above, below = ([_power(name, abs(power)) for name, power in parts if power * sign > 0] for sign in (1, -1))
        return "/".join([" ".join(reversed(above)) or "1", *below]) if parts else ""


def _power(name: str, power: int) -> str:
    return name if power == 1 else name + str(power).translate(_SUPERSCRIPTS)


class Quantity(ABC):
    """A number of a run at any moment; `dimension` are its powers of length, time and mass."""

    dimension: Dimension = (0, 0, 0)

    def begin(self, setting: Setting) -> None:  # noqa: B027 most have nothing to prepare
        """See the scene before the first look.

        Raises:
            NoResultError: the quantity is not defined for this scene.
        """

    def restart(self) -> None:  # noqa: B027 most remember nothing
        """Forget what was seen; the run begins anew."""

    @abstractmethod
    def label(self, setting: Setting) -> str:
        """What it is called in a legend: `z of planet`."""

    @abstractmethod
    def measure(self, look: Look) -> float:
        """The number; NaN where there is none at this moment."""


class OfEach(Quantity):
    """A quantity that every particle of a group, or every spring, has for itself, so that it has a distribution."""

    @abstractmethod
    def each(self, look: Look) -> np.ndarray:
        """The number of every one, (n,)."""


def component_of(vector: np.ndarray, axis: str | None) -> float:
    """One component of a vector, or its length where no axis is said."""
    return float(np.linalg.norm(vector)) if axis is None else float(vector["xyz".index(axis)])


def center_of(values: np.ndarray, snapshot: Snapshot, of: Particles | None) -> np.ndarray:
    """Mean by mass of (particle_count, 3) vectors over a group, or over all; NaN where all have merged into others."""
    chosen = np.zeros(snapshot.particle_count, dtype=bool)
    chosen[rows(of)] = True
    chosen &= snapshot.present
    return mean_by_mass(values[chosen], snapshot.mass[chosen]) if chosen.any() else np.full(3, np.nan)


def of_which(noun: str, name: str) -> str:
    """`z of planet`, or the noun alone."""
    return f"{noun} of {name}" if name else noun
