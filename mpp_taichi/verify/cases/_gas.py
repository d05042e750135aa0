"""Gases of hard disks and spheres for `verify`: the scene, theory for a finite number of spheres, and means over blocks."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.kinetic_theory import kolmogorov_smirnov
from mpp_taichi.kinetic_theory.packing import sphere_volume
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.verify.bounds import chance_beyond, student
from mpp_taichi.verify.case import Found

ROWS = 60  # statistical rows of a report, on all its places
FALSE_ALARMS = 1e-3  # reports of a sound program that may have a red row
CHANCE = FALSE_ALARMS / ROWS  # Bonferroni
BLOCKS = 20


@dataclass(frozen=True)
class Measured:
    """A mean over blocks beside its theory.

    mean, error   of the blocks, and its standard error
    theory        for this number of spheres
    systematic    by how much the theory may be wrong
    """

    mean: float
    error: float
    theory: float
    systematic: float
    because: str
    freedom: int = BLOCKS - 1

    @property
    def z(self) -> float:
        """Standard errors from the theory, with a sign; what is systematic counts for nothing."""
        off = self.mean - self.theory
        return math.copysign(max(0.0, abs(off) - self.systematic), off) / self.error

    @property
    def chance(self) -> float:
        """Probability of such a distance or a larger distance on a sound program."""
        return chance_beyond(self.z, self.freedom)

    def found(self) -> Found:
        """|z| within the bound that chance exceeds once in 1/α runs."""
        why = (
            f"Student's t of {self.freedom + 1} blocks, α = {FALSE_ALARMS:g}/{ROWS}: {self.mean:.6g} ± {self.error:.2g} beside "
            f"{self.theory:.6g}, which may be wrong by {self.systematic:.2g}: {self.because}"
        )
        return Found(abs(self.z), student(CHANCE, self.freedom), why)


@dataclass(frozen=True)
class Distances:
    """A distance of Kolmogorov and Smirnov of so many speeds."""

    distance: float
    count: int

    @property
    def z(self) -> float:
        """√n times the distance."""
        return self.distance * math.sqrt(self.count)

    @property
    def chance(self) -> float:
        """Probability of such a distance or a larger distance on a sound program."""
        return kolmogorov_smirnov.probability(self.distance, self.count)

    def found(self) -> Found:
        """The distance within the bound that chance exceeds once in 1/α runs."""
        why = (
            f"Kolmogorov and Smirnov's test, n = {self.count} speeds, α = {FALSE_ALARMS:g}/{ROWS}; a fixed energy makes large "
            "distances rarer"
        )
        return Found(self.distance, kolmogorov_smirnov.critical_distance(self.count, CHANCE), why)


def of_blocks(values: Any, theory: float, systematic: float, because: str) -> Measured:
    """The mean of values of blocks (n,), which are independent, with the standard error of their scatter."""
    found = np.asarray(values, float)
    error = float(found.std(ddof=1)) / math.sqrt(len(found))
    return Measured(float(found.mean()), error, theory, systematic, because, len(found) - 1)


def box_of(edge: float, dimensions: int) -> dict[str, Any]:
    """Corners of a box from the origin."""
    return {"lower": [0.0] * dimensions, "upper": [edge] * dimensions}


def scene(particles: list[dict[str, Any]], edge: float, dimensions: int, seed: int, **contacts: float) -> dict[str, Any]:
    """Spheres in a periodic box, event by event."""
    return {
        "dimensions": dimensions,
        "seed": seed,
        "particles": particles,
        "contacts": {"hard_spheres": {"solver": "event_driven", **contacts}},
        "walls": [{"periodic_box": box_of(edge, dimensions)}],
        "run": {"duration": 1.0},
    }


def equal_spheres(count: int, packing: float, dimensions: int, seed: int, **contacts: float) -> tuple[dict[str, Any], float]:
    """A gas of spheres of diameter 1, mass 1 and k T = 1 at rest as a whole, and its number density."""
    density = packing / float(sphere_volume(0.5, dimensions))
    edge = (count / density) ** (1.0 / dimensions)
    gas = {"count": count, "radius": 0.5, "temperature": 1.0, "zero_momentum": True, **box_of(edge, dimensions)}
    return scene([{"gas": gas}], edge, dimensions, seed, **contacts), density


def in_blocks(simulation: Simulation, span: float, look: Callable[[Simulation], Any]) -> list[Any]:
    """What `look` gives at the start and at the end of each block of a span of time."""
    found = [look(simulation)]
    for _ in range(BLOCKS):
        simulation.run(duration=span)
        found.append(look(simulation))
    return found


def temperature(velocity: np.ndarray, dimensions: int) -> float:
    """k T of masses of 1 without a common motion, which takes d of the degrees of freedom."""
    return float(np.sum(velocity**2)) / (dimensions * (len(velocity) - 1))


# Theory

VIRIAL = {
    2: (2.0, 3.128018, 4.257854, 5.336897, 6.362960, 7.351506, 8.319104, 9.272141, 10.216294),
    3: (4.0, 10.0, 18.364768, 28.224512, 39.815148, 53.344420, 68.537549, 85.812838, 105.775104),
}
"""Z = 1 + Σ b_k η^k, k = 1 … 9. Source: Clisby & McCoy, J. Stat. Phys. 122 (2006) 15."""


def virial_series(packing: float, dimensions: int) -> tuple[float, float]:
    """Z of the fluid, and the error of the series: its last term times η/(1 − η), as if the terms went on like powers of η."""
    terms = [each * packing ** (k + 1) for k, each in enumerate(VIRIAL[dimensions])]
    return 1.0 + math.fsum(terms), terms[-1] * 1.5 * packing / (1.0 - 1.5 * packing)


def of_finite(state: Callable[[float], float], packing: float, count: int) -> float:
    """Z of so many spheres in a periodic box, from Z(η) of infinitely many.

    Z_N = Z − S η (η Z)″ / 2N with S = 1/(η Z)′: the mean over the grand canonical ensemble is the value of the infinite system,
    and a fixed number takes away half of the variance of the number times the second derivative of the pressure.
    Source: Lebowitz & Percus, Phys. Rev. 124 (1961) 1673. Terms of 1/N² are left out.
    """
    h = 1e-3 * packing
    low, middle, high = ((packing + k * h) * state(packing + k * h) for k in (-1, 0, 1))
    first, second = (high - low) / (2.0 * h), (high - 2.0 * middle + low) / h**2
    return state(packing) - packing * second / (2.0 * count * first)


def slowing(freedoms: int) -> float:
    """Mean size of a velocity component at a fixed energy, over its mean size in the normal distribution of this variance.

    √(n/2) Γ(n/2) / Γ((n + 1)/2) for n degrees of freedom, 1 + 1/4n for many.
    """
    return math.sqrt(0.5 * freedoms) * math.exp(math.lgamma(0.5 * freedoms) - math.lgamma(0.5 * (freedoms + 1)))
