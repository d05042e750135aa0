"""Counts of a contact solver. Host side; no Taichi."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ContactReport:
    """Counts of a solver since the last report; reports can be added.

    pair_count, wall_count   collisions of two spheres, and of a sphere with a surface
    elastic_count            number of these collisions that the TC model made elastic
    virial                   Σ Δp · r over collisions of pairs, Δp the momentum given to i, r = x_i − x_j [energy]
    wall_impulse             for each account of the enclosure Σ |Δp| [momentum]
    dissipated_energy        kinetic energy taken by restitution, or by merging [energy]
    merge_count              spheres that became part of another
    potential_change         of the forces' potential energy when spheres became one [energy]
    largest_overlap          largest overlap of two spheres, or of a sphere and a surface, over the smaller radius; not a sum
    missed_energy            of bounces that a solver for resting spheres left out, as spheres met again in a drift [energy]
    unresolved               contacts that were given up; a run with such contacts ends with an error
    """

    pair_count: int = 0
    wall_count: int = 0
    elastic_count: int = 0
    virial: float = 0.0
    wall_impulse: tuple[float, ...] = ()
    dissipated_energy: float = 0.0
    merge_count: int = 0
    potential_change: float = 0.0
    largest_overlap: float = 0.0
    missed_energy: float = 0.0
    unresolved: int = 0

    def __add__(self, other: "ContactReport") -> "ContactReport":
        """The counts of both reports together."""
        impulses = self.wall_impulse or (0.0,) * len(other.wall_impulse)
        others = other.wall_impulse or (0.0,) * len(impulses)
        return ContactReport(
            pair_count=self.pair_count + other.pair_count,
            wall_count=self.wall_count + other.wall_count,
            elastic_count=self.elastic_count + other.elastic_count,
            virial=self.virial + other.virial,
            wall_impulse=tuple(a + b for a, b in zip(impulses, others, strict=True)),
            dissipated_energy=self.dissipated_energy + other.dissipated_energy,
            merge_count=self.merge_count + other.merge_count,
            potential_change=self.potential_change + other.potential_change,
            largest_overlap=max(self.largest_overlap, other.largest_overlap),
            missed_energy=self.missed_energy + other.missed_energy,
            unresolved=self.unresolved + other.unresolved,
        )
