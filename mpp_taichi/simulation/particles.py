"""Particles by their names: `simulation.particles["earth"].position`, read from the device when it is asked for."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from mpp_taichi.errors import ArgumentError, PlacementError
from mpp_taichi.scene.layout import ParticleLayout, layout_of
from mpp_taichi.snapshot import Snapshot


class Particle:
    """One particle of a simulation; each attribute is read at the present time."""

    def __init__(self, simulation: Any, index: int) -> None:
        """The particle of an index."""
        self._simulation, self.index = simulation, index

    def _now(self) -> Snapshot:
        found: Snapshot = self._simulation.snapshot()
        return found

    @property
    def name(self) -> str:
        """Its name; empty where it has none."""
        return str(self._simulation.start.name[self.index])

    @property
    def position(self) -> np.ndarray:
        """[length], shape (3,)."""
        return self._now().position[self.index]

    @property
    def velocity(self) -> np.ndarray:
        """[length / time], shape (3,)."""
        return self._now().velocity[self.index]

    @property
    def momentum(self) -> np.ndarray:
        """Mass times velocity, shape (3,)."""
        now = self._now()
        return now.mass[self.index] * now.velocity[self.index]

    @property
    def acceleration(self) -> np.ndarray:
        """By the forces now, as `Simulation.accelerations`, shape (3,)."""
        found: np.ndarray = self._simulation.accelerations()[self.index]
        return found

    @property
    def mass(self) -> float:
        """[mass]."""
        return float(self._now().mass[self.index])

    @property
    def radius(self) -> float:
        """[length]."""
        return float(self._now().radius[self.index])

    @property
    def charge(self) -> float:
        """[charge]."""
        return float(self._now().charge[self.index])

    def __repr__(self) -> str:
        """Index, name, mass and place."""
        now, named = self._now(), f" {self.name!r}" if self.name else ""
        place = ", ".join(f"{x:.6g}" for x in now.position[self.index])
        return f"<particle {self.index}{named}: mass {now.mass[self.index]:.6g}, position ({place})>"


class Particles:
    """Some or all particles of a simulation; each attribute is an array over them, read at the present time.

    `particles["earth"]` and `particles[3]` are one particle, `particles["ring"]`, `particles["ring[10:20]"]` and
    `particles[10:20]` are several. They are in the order of the scene.
    """

    def __init__(self, simulation: Any, indices: range | None = None, layout: ParticleLayout | None = None) -> None:
        """All particles, or those of the indices."""
        self._simulation = simulation
        self.indices = range(simulation.start.particle_count) if indices is None else indices
        self._layout = layout

    def __len__(self) -> int:
        """Count the particles."""
        return len(self.indices)

    def __iter__(self) -> Iterator[Particle]:
        """Each particle."""
        return (Particle(self._simulation, index) for index in self.indices)

    def __getitem__(self, key: int | slice | str) -> "Particle | Particles":
        """The particle of an index or of a name, or the particles of a slice or of a group.

        Raises:
            ArgumentError: the scene has no such particle; the message names the nearest.
            IndexError: the index is beyond the particles.
        """
        if isinstance(key, str):
            return self._by_name(key)
        if isinstance(key, slice):
            return Particles(self._simulation, self.indices[key], self._layout)
        try:
            return Particle(self._simulation, self.indices[key])
        except IndexError:
            raise IndexError(f"there is no particle {key}, allowed: {-len(self)} to {len(self) - 1}") from None
        except TypeError:
            raise ArgumentError(f"a particle is found by its index, a slice or a name, not by {key!r}") from None

    def __contains__(self, key: object) -> bool:
        """Whether there is a particle or a group of a name."""
        return isinstance(key, str) and key in self._known().names

    def _known(self) -> ParticleLayout:
        if self._layout is None:
            self._layout = layout_of(self._simulation.spec)
        return self._layout

    def _by_name(self, name: str) -> "Particle | Particles":
        layout = self._known()
        group = layout.group(name)
        if group is not None and (group[1] > 1 or name.endswith(":]")):
            found = range(group[0], group[0] + group[1])
            return Particles(self._simulation, found, layout)
        rows = self._simulation.start.name
        if name in rows and name not in layout.names:  # a name from a file of particles
            return Particle(self._simulation, rows.index(name))
        try:
            return Particle(self._simulation, layout.find(name))
        except PlacementError as error:
            raise ArgumentError(f"particles[{name!r}]: {error}") from None

    def _rows(self, values: np.ndarray) -> np.ndarray:
        return values[self.indices.start : self.indices.stop : self.indices.step] if len(self) else values[:0]

    @property
    def name(self) -> tuple[str, ...]:
        """The name of each; empty where it has none."""
        return tuple(self._simulation.start.name[index] for index in self.indices)

    @property
    def position(self) -> np.ndarray:
        """[length], shape (count, 3)."""
        return self._rows(self._simulation.snapshot().position)

    @property
    def velocity(self) -> np.ndarray:
        """[length / time], shape (count, 3)."""
        return self._rows(self._simulation.snapshot().velocity)

    @property
    def mass(self) -> np.ndarray:
        """[mass], shape (count,)."""
        return self._rows(self._simulation.snapshot().mass)

    @property
    def radius(self) -> np.ndarray:
        """[length], shape (count,)."""
        return self._rows(self._simulation.snapshot().radius)

    @property
    def charge(self) -> np.ndarray:
        """[charge], shape (count,)."""
        return self._rows(self._simulation.snapshot().charge)

    def __repr__(self) -> str:
        """The number of particles, and the first names."""
        named = [name for name in self.name[:5] if name]
        told = f": {', '.join(named)}{', …' if len(self) > len(named) else ''}" if named else ""
        return f"<{len(self):,} particles{told}>"
