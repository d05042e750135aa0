"""Generator: parameters of one entry of `particles:` → a group of particles, in NumPy on the host."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

DEFAULT_COLOR = (0.9, 0.9, 0.9)


@dataclass(frozen=True, eq=False)
class Group:
    """The particles of one entry: arrays as in `Snapshot`, and their positions in the springs' state of rest.

    rest_position   shape (particle_count, 3); differs from position where a generator displaces its particles
    """

    position: np.ndarray
    velocity: np.ndarray
    mass: np.ndarray
    radius: np.ndarray
    charge: np.ndarray
    color: np.ndarray
    free: np.ndarray
    rest_position: np.ndarray
    name: tuple[str, ...]

    def __len__(self) -> int:
        """Count the particles."""
        return len(self.mass)


@dataclass(frozen=True)
class Center:
    """A particle around which other particles are placed; `held` along every axis, it does not react to them."""

    position: np.ndarray
    velocity: np.ndarray
    mass: float
    held: bool = False


@dataclass(frozen=True, eq=False)
class GeneratorContext:
    """The data that a generator may use.

    random    the entry's own source of random numbers, which does not depend on other entries
    strength, softening   of the scene's newtonian_gravity; (0, 0) in a scene without it
    find      particles placed by the entries before this one, by index
    dimensions  2 or 3
    placed    the groups of the entries before this one; a group may hold the particles of several entries
    """

    random: np.random.Generator
    strength: float
    softening: float
    find: Callable[[int], Center]
    dimensions: int = 3
    placed: Sequence[Group] = ()


class Generator(ABC):
    """A generator of particles. Its parameters are declared in its file.

    one_particle   whether an entry makes one particle, whatever its parameters are
    takes_path     whether the particle may move on a given path, the parameter `path`
    """

    one_particle = False
    takes_path = False

    @abstractmethod
    def particle_count(self) -> int:
        """The number of particles, found without making them."""

    @classmethod
    def at_once(cls, entries: Iterable[Mapping[str, Any]]) -> Group | None:
        """The particles of the first of these entries, given by their parameters, whose particles need no context.

        None where the first entry needs one. The group is the one that `generate` makes of each, one after the other.
        """
        return None

    @abstractmethod
    def generate(self, context: GeneratorContext) -> Group:
        """Make the particles; PlacementError where they cannot be placed."""


def make_group(count: int, *, position: Any, **given: Any) -> Group:
    """A group from positions and other arrays; each is one value for all particles or one value for each."""

    def fill(key: str, default: Any, shape: tuple[int, ...], kind: Any = float) -> np.ndarray:
        return np.array(np.broadcast_to(np.asarray(given.get(key, default), dtype=kind), shape))

    vectors, scalars = (count, 3), (count,)
    place = np.array(np.broadcast_to(np.asarray(position, dtype=float), vectors))
    return Group(
        position=place,
        velocity=fill("velocity", 0.0, vectors),
        mass=fill("mass", 0.0, scalars),
        radius=fill("radius", 0.0, scalars),
        charge=fill("charge", 0.0, scalars),
        color=fill("color", DEFAULT_COLOR, vectors),
        free=fill("free", True, vectors, bool),
        rest_position=fill("rest_position", place, vectors),
        name=tuple(given.get("name", ("",) * count)),
    )
