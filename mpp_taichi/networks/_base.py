"""Network: parameters of one entry of `springs:` → springs between particles, in NumPy on the host."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.errors import PlacementError
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

    bends = False  # True: makes hinges, of springs of which some have a negative stiffness

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
    between: np.ndarray,
    context: NetworkContext,
    *,
    rest_length: float | None,
    stretch: float = 1.0,
    breaks_at: float | None = None,
    yields_at: float | None = None,
    **given: Any,
) -> Springs:
    """Springs between pairs of particles; without a rest length they are at rest as placed, divided by `stretch`.

    `breaks_at` and `yields_at` are strains, by which the limits of the springs are multiples of their rest lengths.

    Raises:
        PlacementError: springs have a strain as a limit, and no rest length of which it could be a part.
    """
    count = len(between)
    separation = context.rest_position[between[:, 1]] - context.rest_position[between[:, 0]]
    with np.errstate(over="ignore"):  # check_physics refuses positions that are so large, by the names of the particles
        placed = np.sqrt(np.sum(separation**2, axis=1)) / stretch
    rest = placed if rest_length is None else np.full(count, rest_length, dtype=float)
    limits = {}
    if breaks_at is not None or yields_at is not None:
        if count and not rest.min() > 0.0:
            name = "breaks_at" if breaks_at is not None else "yields_at"
            raise PlacementError(f"{name} is a strain, which a spring without a rest length does not have")
        never = np.full(count, np.inf)
        limits = {
            "breaking_length": never if breaks_at is None else rest * (1.0 + breaks_at),
            "yield_stretch": never if yields_at is None else rest * yields_at,
            "broke_at": never,
        }
    return Springs(
        between=between.astype(np.int32),
        stiffness=np.full(count, given["stiffness"], dtype=float),
        damping=np.full(count, given["damping"], dtype=float),
        rest_length=rest,
        color=np.array(np.broadcast_to(np.asarray(given["color"], dtype=float), (count, 3))),
        **limits,
    )
