"""Lattice theory: frequencies and shapes of a lattice of springs with its ends or its rim held, in closed form."""

import itertools
from dataclasses import dataclass

import numpy as np

from mpp_taichi.modes.linear_network import LinearNetwork

ALIKE = 1e-9  # relative: closer values are taken as equal; the difference changes a frequency by half as much


class NoTheoryError(ValueError):
    """The springs of a scene are not the lattice that has a closed form; the message says why."""


@dataclass(frozen=True)
class LatticeTheory:
    """Small vibrations of a chain, sheet or block of n₁ × n₂ × n₃ equal particles along one direction, its ends or rim held.

    Neighbours along lattice axis a are at the distance d_a on springs of stiffness D_a and tension T_a. A displacement across
    the axis is resisted by κ_a = T_a / d_a, one along it by κ_a = D_a. With mode numbers r_a = 1 … n_a − 2

        ω² = (4/m) Σ_a κ_a sin²(r_a π / 2(n_a − 1)),  shape Π_a sin(r_a π k_a / (n_a − 1)),  k_a = 0 … n_a − 1,

    over the axes that have more than one particle. A chain of n free particles between held ends is n_a − 1 = n + 1; along
    itself it has ω = 2 √(D/m) sin(r π / 2(n + 1)). Source: Fetter and Walecka, Theoretical Mechanics (1980), §24.

    first, counts   index of the lattice's first particle, and its counts along the axes
    direction       axis of space that the particles move along, 0 … 2
    mass            m of each
    resistance      κ_a of each lattice axis [force length⁻¹], 0 on an axis of one particle
    """

    first: int
    counts: tuple[int, int, int]
    direction: int
    mass: float
    resistance: tuple[float, float, float]

    def angular_frequency(self, numbers: tuple[int, int, int]) -> float:
        """ω of a mode [radians time⁻¹]; 0 where the lattice resists no small displacement, NaN where it buckles."""
        terms = [
            resistance * np.sin(0.5 * np.pi * number / (count - 1)) ** 2
            for number, count, resistance in zip(numbers, self.counts, self.resistance)
            if count > 1
        ]
        square = 4.0 / self.mass * sum(terms)
        return float(np.sqrt(square)) if square >= 0.0 else float("nan")

    def shape(self, numbers: tuple[int, int, int], particle_count: int, dimensions: int) -> np.ndarray:
        """Displacements of the mode at amplitude 1, shape (particle_count, dimensions)."""
        return lattice_shape(self.first, self.counts, self.direction, numbers, (particle_count, dimensions))

    def _order(self, numbers: tuple[int, int, int]) -> float:
        """The frequency, rounded so that equal frequencies agree; modes that do not vibrate come first."""
        return float(f"{np.nan_to_num(self.angular_frequency(numbers)):.9g}")

    def lowest(self, count: int) -> list[tuple[int, int, int]]:
        """The mode numbers of the lowest frequencies, in rising order; at equal frequencies the smaller numbers come first."""
        first, second, third = (range(1, min(count, max(1, points - 2)) + 1) for points in self.counts)
        rising = sorted(itertools.product(first, second, third), key=lambda each: (self._order(each), sum(each), -each[0]))
        return rising[:count]


def lattice_shape(
    first: int, counts: tuple[int, int, int], direction: int, numbers: tuple[int, int, int], size: tuple[int, int]
) -> np.ndarray:
    """Π sin(r_a π k_a / (n_a − 1)) along one direction of the particles of a lattice, 0 for all others, shape `size`."""
    profile = np.ones(1)
    for count, number in zip(counts, numbers):
        along = np.sin(np.pi * number * np.arange(count) / (count - 1)) if count > 1 else np.ones(1)
        profile = (along[:, None] * profile).ravel()  # the first axis varies fastest in the index
    shape = np.zeros(size)
    shape[first : first + len(profile), direction] = profile
    return shape


def lattice_theory(network: LinearNetwork, first: int, counts: tuple[int, int, int], direction: int) -> LatticeTheory:
    """The theory of a lattice, if the springs of a scene are one.

    Raises:
        NoTheoryError: masses or springs are unequal, its particles have other springs, or its ends or rim are not held.
    """
    index = (first + np.arange(np.prod(counts))).reshape(counts[::-1])
    rim = np.zeros(index.shape, dtype=bool)
    for axis, count in enumerate(counts[::-1]):
        if count > 1:
            rim[(slice(None),) * axis + ([0, -1],)] = True
    inner = index[~rim]
    if not len(inner) or not rim.any():
        raise NoTheoryError("it has no particle inside held ends")
    if network.free[index[rim], direction].any():
        raise NoTheoryError("its ends or its rim are not held")
    if not network.free[inner, direction].all():
        raise NoTheoryError("a particle inside is held")
    mass = network.mass[inner]
    if np.ptp(mass) > ALIKE * mass.max():
        raise NoTheoryError("its masses differ")
    found = [_along(network, index, rim, axis, direction) for axis in range(3)]
    inside = np.zeros(len(network.mass), dtype=bool)
    inside[inner] = True
    if sum(springs for _, springs in found) != np.count_nonzero(inside[network.between].any(axis=1)):
        raise NoTheoryError("its particles have other springs as well as springs to their nearest neighbours")
    resistance = tuple(float(each) for each, _ in found)
    return LatticeTheory(first, counts, direction, float(mass[0]), (resistance[0], resistance[1], resistance[2]))


def _along(network: LinearNetwork, index: np.ndarray, rim: np.ndarray, axis: int, direction: int) -> tuple[float, int]:
    """κ of one lattice axis, and the number of springs along it that act on the inner particles."""
    place = 2 - axis  # the last axis of the array is the first of the lattice
    if index.shape[place] == 1:
        return 0.0, 0
    length = index.shape[place]
    near, far = np.take(index, range(length - 1), place), np.take(index, range(1, length), place)
    moving = ~(np.take(rim, range(length - 1), place) & np.take(rim, range(1, length), place))
    wanted = np.stack([near[moving], far[moving]], axis=1)
    count = len(network.mass)
    keys = np.sort(network.between, axis=1) @ np.array([count, 1])
    order = np.argsort(keys, kind="stable")
    at = np.searchsorted(keys[order], wanted @ np.array([count, 1]))
    at = order[np.minimum(at, len(order) - 1)]
    if not np.array_equal(keys[at], wanted @ np.array([count, 1])):
        raise NoTheoryError("a spring between nearest neighbours is missing")
    separation = network.position[wanted[:, 1]] - network.position[wanted[:, 0]]
    step = separation.mean(axis=0)
    if np.abs(separation - step).max() > ALIKE * np.abs(step).max():
        raise NoTheoryError("its particles are not at equal distances")
    if np.count_nonzero(np.abs(step) > ALIKE * np.abs(step).max()) != 1:
        raise NoTheoryError("its axes are not the axes of space")
    along = abs(step[direction]) > ALIKE * np.abs(step).max()
    values = (network.axial if along else network.lateral)[at]
    if np.ptp(values) > ALIKE * network.axial[at].max(initial=0.0):
        raise NoTheoryError("its springs differ along an axis")
    return float(values.mean()), len(at)
