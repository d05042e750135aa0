"""Counts of a contact solver. Host side; no Taichi."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import zip_longest

# Sums of real numbers, beside the impulses on walls.
SUMS = ("virial", "dissipated_energy", "potential_change", "missed_energy", "wall_work")


@dataclass(frozen=True)
class ContactReport:
    """Counts of a solver since the last report; reports can be added.

    Sums of real numbers are added exactly, so that it does not matter how a run was divided into reports.

    pair_count, wall_count   collisions of two spheres, and of a sphere with a surface
    elastic_count            number of these collisions that the TC model made elastic
    virial                   Σ Δp · r over collisions of pairs, Δp the momentum given to i, r = x_i − x_j [energy]
    wall_impulse             for each account of the enclosure Σ |Δp| [momentum]
    dissipated_energy        kinetic energy taken by restitution, or by merging [energy]
    merge_count              spheres that became part of another
    potential_change         of the forces' potential energy when spheres became one [energy]
    largest_overlap          largest overlap of two spheres, or of a sphere and a surface, over the smaller radius; not a sum
    missed_energy            of bounces that a solver for resting spheres left out, as spheres met again in a drift [energy]
    wall_work                work of moving walls on spheres, as `swept`, `simultaneous` and `pairwise` count it [energy]
    unresolved               contacts that were given up; a run with such contacts ends with an error
    rests                    what rounding has left out of each of SUMS and then of each impulse on a wall, as a sum of floats
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
    wall_work: float = 0.0
    unresolved: int = 0
    rests: tuple[tuple[float, ...], ...] = ()

    def __add__(self, other: "ContactReport") -> "ContactReport":
        """The counts of both reports together."""
        sums, walls, rests = _split(_exact(mine + its) for mine, its in zip_longest(self._sums(), other._sums(), fillvalue=()))
        return ContactReport(
            pair_count=self.pair_count + other.pair_count,
            wall_count=self.wall_count + other.wall_count,
            elastic_count=self.elastic_count + other.elastic_count,
            merge_count=self.merge_count + other.merge_count,
            largest_overlap=max(self.largest_overlap, other.largest_overlap),
            unresolved=self.unresolved + other.unresolved,
            wall_impulse=walls,
            rests=rests,
            **sums,
        )

    def sums_since(self, earlier: "ContactReport") -> "ContactReport":
        """This report with the growth of its sums since an earlier report of the same sums; the counts stay."""
        both = zip_longest(self._sums(), earlier._sums(), fillvalue=())
        sums, walls, rests = _split(_exact((*now, *(-each for each in before))) for now, before in both)
        return replace(self, wall_impulse=walls, rests=rests, **sums)

    def _sums(self) -> list[tuple[float, ...]]:
        """Each sum as floats whose exact sum it is, in the order of `rests`."""
        rounded = (*(getattr(self, name) for name in SUMS), *self.wall_impulse)
        return [(value, *rest) for value, rest in zip_longest(rounded, self.rests, fillvalue=())]


def _split(exact: Iterable[tuple[float, ...]]) -> tuple[dict[str, float], tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """The rounded sums by name, the rounded impulses on walls, and the rests of all."""
    found = list(exact)
    rounded, rests = [each[0] for each in found], tuple(each[1:] for each in found)
    return dict(zip(SUMS, rounded)), tuple(rounded[len(SUMS) :]), rests if any(rests) else ()


def _exact(terms: tuple[float, ...]) -> tuple[float, ...]:
    """The exact sum of floats, as its nearest float and the floats that are left; a sum that is not finite is left as it is."""
    if not any(terms):
        return (0.0,)
    if not math.isfinite(sum(terms)):
        return (sum(terms),)
    found: list[float] = []
    while (rest := math.fsum((*terms, *(-each for each in found)))) != 0.0:
        found.append(rest)
    return tuple(found) or (0.0,)
