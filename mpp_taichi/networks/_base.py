"""Network: parameters of one entry of `springs:` → springs between particles, in NumPy on the host."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.snapshot import Rods, Springs


@dataclass(frozen=True, eq=False)
class NetworkContext:
    """The data that a network may use.

    rest_position   of every particle, shape (particle_count, 3)
    lattice         name → (index of its first particle, counts along the axes); PlacementError for an unknown name
    """

    rest_position: np.ndarray
    lattice: Callable[[str], tuple[int, tuple[int, int, int]]]


class Network(ABC):
    """A generator of springs, or of rods. Its parameters are declared in its file."""

    links_lattice = False  # True: links the neighbours in the lattice that the parameter `of` names, with a `prestretch`

    is_rigid = False  # True: makes rods in place of springs

    @abstractmethod
    def spring_count(self, lattice: Callable[[str], tuple[int, tuple[int, int, int]]]) -> int:
        """The number of springs, found without making them."""

    @abstractmethod
    def generate(self, context: NetworkContext) -> Springs:
        """Make the springs; PlacementError where they cannot be made."""

    def rods(self, position: np.ndarray) -> Rods:
        """The rods between particles at these positions, (particle_count, 3), where the network `is_rigid`."""
        return Rods()


def make_springs(
    between: np.ndarray, context: NetworkContext, *, rest_length: float | None, stretch: float = 1.0, **given: Any
) -> Springs:
    """Springs between pairs of particles; without a rest length they are at rest as placed, divided by `stretch`."""
    count = len(between)
    separation = context.rest_position[between[:, 1]] - context.rest_position[between[:, 0]]
    with np.errstate(over="ignore"):  # check_physics refuses positions that are so large, by the names of the particles
        placed = np.sqrt(np.sum(separation**2, axis=1)) / stretch
    return Springs(
        between=between.astype(np.int32),
        stiffness=np.full(count, given["stiffness"], dtype=float),
        damping=np.full(count, given["damping"], dtype=float),
        rest_length=placed if rest_length is None else np.full(count, rest_length, dtype=float),
        color=np.array(np.broadcast_to(np.asarray(given["color"], dtype=float), (count, 3))),
    )
