"""Layout: which particles and springs each entry of a scene makes, known without making them."""

import bisect
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from mpp_taichi import component
from mpp_taichi.errors import PlacementError, SceneError
from mpp_taichi.scene.did_you_mean import choices
from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec

_PART = re.compile(r"(?P<name>[^\[\]]+)\[(?P<first>[0-9]{0,9}):(?P<end>[0-9]{0,9})\]", re.ASCII)
Lattice = tuple[int, tuple[int, int, int]]  # index of the first particle, counts along the axes


@dataclass(frozen=True, eq=False)
class ParticleLayout:
    """The number of particles of each entry of `particles:`, and the index of its first particle."""

    entries: tuple[ComponentSpec, ...]
    counts: tuple[int, ...]
    starts: tuple[int, ...]
    names: dict[str, int]  # name of an entry → its number
    lattices: dict[str, Lattice]

    @property
    def total(self) -> int:
        """All particles."""
        return self.starts[-1] + self.counts[-1] if self.counts else 0

    def entry_of(self, index: int) -> int:
        """The entry that made a particle."""
        return bisect.bisect_right(self.starts, index) - 1

    def name_of(self, index: int) -> str:
        """`earth`, or `ring[3]` in a group; empty where the entry that made the particle has no name."""
        number = self.entry_of(index)
        name = self.entries[number].parameters.get("name") or ""
        return f"{name}[{index - self.starts[number]}]" if name and self.counts[number] > 1 else str(name)

    def label(self, index: int) -> str:
        """The text for a particle in messages: its name, the name of its group, or only its index."""
        number = self.entry_of(index)
        name = self.entries[number].parameters.get("name") or self.entries[number].name
        part = f"{name}[{index - self.starts[number]}]" if self.counts[number] > 1 else name
        return f"particle {index} ({part})"

    def find(self, reference: int | str) -> int:
        """Index of a particle given by index, by name, or as `group[number]`; PlacementError lists the names that exist."""
        if isinstance(reference, int):
            if not 0 <= reference < self.total:
                raise PlacementError(f"there is no particle {shown(reference)}, allowed: 0 to {shown(self.total - 1)}")
            return reference
        word, _, rest = reference.partition("[")
        number = self.names.get(word)
        if number is None:
            raise PlacementError(f"no particle is called {shown(word)}{choices(word, self.names)}")
        count = self.counts[number]
        digits = rest.removesuffix("]") if rest.endswith("]") else "-"
        offset = int(digits) if digits.isascii() and digits.isdigit() and len(digits) < 12 else -1
        offset = 0 if not rest and count == 1 else offset
        if not 0 <= offset < count:
            raise PlacementError(f"{shown(reference)} is no single particle, allowed: {word}[0] to {word}[{shown(count - 1)}]")
        return self.starts[number] + offset

    def check_mode(self, name: str | None, numbers: tuple[int, int, int]) -> None:
        """Refuse numbers that no mode of a lattice has; PlacementError says which numbers are allowed."""
        if name is None:
            return  # the modes of a network are counted only when its matrix is solved
        most = [max(1, count - 2) for count in self.lattice(name)[1]]
        if any(number > largest for number, largest in zip(numbers, most, strict=True)):
            raise PlacementError(f"{name} has no mode {list(numbers)}, allowed: from [1, 1, 1] to {most}")

    def group(self, reference: int | str) -> tuple[int, int] | None:
        """First index and count of the entry of this name, or of its part `name[first:end]`; None without such an entry."""
        if not isinstance(reference, str):
            return None
        part = _PART.fullmatch(reference)
        number = self.names.get(part["name"] if part else reference)
        if number is None:
            return None
        count = self.counts[number]
        first, end = (int(part["first"] or 0), int(part["end"] or count)) if part else (0, count)
        return (self.starts[number] + first, end - first) if first < end <= count else None

    def lattice(self, name: str) -> Lattice:
        """The lattice of a name; PlacementError lists the lattices that exist."""
        if name not in self.lattices:
            raise PlacementError(f"of: no lattice is called {shown(name)}{choices(name, self.lattices)}")
        return self.lattices[name]


def build(kind: str, entry: ComponentSpec) -> Any:
    """The component of an entry, with its parameters."""
    return component.build(kind, entry.name, entry.parameters)


def particle_layout(entries: Sequence[ComponentSpec], count: Callable[[ComponentSpec], int]) -> ParticleLayout:
    """Lay out the entries; `count` gives the particles of one."""
    counts = tuple(count(entry) for entry in entries)
    starts = tuple(sum_before(counts))
    names: dict[str, int] = {}
    lattices: dict[str, Lattice] = {}
    for number, (entry, start) in enumerate(zip(entries, starts, strict=True)):
        name = entry.parameters.get("name")
        if name:
            names.setdefault(name, number)
        if name and "shape" in entry.parameters:
            lattices.setdefault(name, (start, entry.parameters["shape"]))
    return ParticleLayout(tuple(entries), counts, starts, names, lattices)


def layout_of(spec: SceneSpec) -> ParticleLayout:
    """The layout of a checked scene; SceneError where a file that the scene names can no longer be read as it was."""
    single = singles(spec.particles)

    def count(entry: ComponentSpec) -> int:
        try:
            return 1 if entry.name in single else build("generators", entry).particle_count()
        except PlacementError as error:
            raise SceneError(f"{entry.location}: {entry.name}: {error}") from None

    return particle_layout(spec.particles, count)


def singles(entries: Sequence[ComponentSpec]) -> set[str]:
    """The components among these entries that make one particle each, whatever their parameters are."""
    return {name for name in {entry.name for entry in entries} if component.flag("generators", name, "one_particle")}


def sum_before(counts: Sequence[int]) -> list[int]:
    """For every entry the sum of the entries before it."""
    starts, total = [], 0
    for count in counts:
        starts.append(total)
        total += count
    return starts
