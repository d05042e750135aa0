"""Quantity: a number, or an array, that one sample of a run has. Panels, tables and expectations all measure quantities."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mpp_taichi.component import Particles
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.errors import StabilityError
from mpp_taichi.scene.human_units import unit_of
from mpp_taichi.scene.layout import ParticleLayout, layout_of
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.state.tangent_growth import TangentGrowth

Dimension = tuple[int, int, int]
"""Powers of length, time and mass."""
ENERGY: Dimension = (2, -2, 1)


class NoResultError(StabilityError):
    """A quantity is not defined for this scene or in this sample, or the run ended too early; the message says why."""


class RunSample(Protocol):
    """A run at one moment. Entries that are expensive are computed when they are first read."""

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
        """The sum over all forces that have a potential."""

    @property
    def pair_virial(self) -> float:
        """The virial Σ F_ij·(x_i − x_j) of all pairs [energy], of pair forces in a periodic box."""

    @property
    def acceleration(self) -> np.ndarray:
        """Accelerations of the particles by the forces, without rods and contacts, (particle_count, 3)."""

    @property
    def tangent(self) -> TangentGrowth:
        """The growth of a small deviation, with one entry, where a quantity `needs_tangent`."""

    @property
    def gravity(self) -> float:
        """The strength G of gravity now; 0 without gravity."""

    @property
    def contact_report(self) -> ContactReport:
        """The counts of the contacts since the start of the run."""


@dataclass(frozen=True, eq=False)
class Setting:
    """The data that a quantity has before the first sample: the scene, its start, and the names of its particles."""

    spec: SceneSpec
    start: Snapshot

    @cached_property
    def layout(self) -> ParticleLayout:
        """Index of the first particle of each entry."""
        return layout_of(self.spec)

    def name_of(self, of: Particles | int | None) -> str:
        """`planet`, `sheet[27]`, `particle 30`, the name of a group or `sheet[8:16]`; for all particles the empty word."""
        if of is None:
            return ""
        first, count = (of, 1) if isinstance(of, int) else of
        if count == 1:
            return self.layout.name_of(first) or f"particle {first}"
        number = self.layout.entry_of(first)
        entry, offset = self.layout.entries[number], first - self.layout.starts[number]
        name = entry.parameters.get("name") or entry.name
        return name if count == self.layout.counts[number] else f"{name}[{offset}:{offset + count}]"

    def unit(self, dimension: Dimension) -> str:
        """`AU/day`, `Msun AU²/day²`; empty for pure numbers, and where the scene names no units."""
        return unit_of(self.spec.units, dimension)


class ManySample(Protocol):
    """Several copies of one system at the same time, as arrays with an entry for each copy."""

    @property
    def time(self) -> float:
        """Simulated time."""

    @property
    def snapshot(self) -> Any:
        """Particles with position and velocity (copies, particle_count, 3) and mass (copies, particle_count)."""

    @property
    def potential_energy(self) -> np.ndarray:
        """The sum over all forces that have a potential, (copies,)."""

    @property
    def tangent(self) -> TangentGrowth:
        """The growth of a small deviation of each copy."""


class Quantity(ABC):
    """A number that a sample of a run has; `dimension` holds its powers of length, time and mass."""

    dimension: Dimension = (0, 0, 0)
    remembers = False
    """Whether the number depends on the samples before, so that every sample must be measured."""
    has_rate = False
    """Whether `rate` is known."""
    needs_tangent = False
    """Whether each step must be taken together with its derivative."""
    needs_derivative = False
    """Whether the derivative is needed along all directions, not along one of them."""
    takes_many = False
    """Whether `measure_many` is known, and so are `rate_many` and `sampling_interval_many` where there is a rate."""
    if TYPE_CHECKING:

        def __init__(self, **parameters: Any) -> None:
            """`@component` gives each quantity the parameters that it declares."""

    def begin(self, setting: Setting) -> None:  # noqa: B027 most have nothing to prepare
        """Prepare for a scene, before the first sample.

        Raises:
            NoResultError: the quantity is not defined for this scene.
        """

    def restart(self) -> None:  # noqa: B027 most remember nothing
        """Forget the samples; the run begins anew."""

    @abstractmethod
    def label(self, setting: Setting) -> str:
        """The name of the quantity in a legend: `z of planet`."""

    @abstractmethod
    def measure(self, sample: RunSample) -> float:
        """The number.

        Raises:
            NoResultError: the sample has no such number.
        """

    def rate(self, sample: RunSample) -> float:
        """The change of the number per time, of quantities that know it."""
        raise NotImplementedError(f"{type(self).__name__} knows no rate")

    def sampling_interval(self, sample: RunSample) -> float | None:
        """Longest time until the next sample in which the number changes little; None where its rates tell."""
        return None

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The number of each of several copies of a system, (copies,); NaN where a copy has none."""
        raise NotImplementedError(f"{type(self).__name__} measures one copy at a time")

    def rate_many(self, many: ManySample) -> np.ndarray:
        """The change of each of these numbers per time, (copies,)."""
        raise NotImplementedError(f"{type(self).__name__} knows no rate")

    def sampling_interval_many(self, many: ManySample) -> np.ndarray | None:
        """`sampling_interval` of each copy, (copies,); None where its rates tell."""
        return None


class OfEach(Quantity):
    """A quantity that every particle of a group, or every spring, has for itself, so that it has a distribution."""

    @abstractmethod
    def each(self, sample: RunSample) -> np.ndarray:
        """The numbers of all particles or springs, (n,)."""


def of_which(noun: str, name: str) -> str:
    """`z of planet`, or only the noun."""
    return f"{noun} of {name}" if name else noun
