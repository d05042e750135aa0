"""What every contact solver is given, and what it tells. Host side; no Taichi."""

from dataclasses import dataclass
from typing import Any

from mpp_taichi.contact_setup import ContactSetup

__all__ = ["ContactReport", "ContactSetup"]


@dataclass(frozen=True)
class ContactReport:
    """What a solver counted since it was last asked; reports add.

    pair_count, wall_count   collisions of two spheres, and of a sphere with a surface
    elastic_count            of those, bounces that the TC model made elastic
    virial                   Σ Δp · r over collisions of pairs, Δp the momentum given to i, r = x_i − x_j [energy]
    wall_impulse             for each surface Σ |Δp| [momentum]
    dissipated_energy        kinetic energy taken by restitution [energy]
    largest_overlap          of two spheres, or a sphere and a surface, that was seen, relative to the smaller radius; not a sum
    unresolved               contacts that a solver gave up on: must be 0 or the run fails
    """

    pair_count: int = 0
    wall_count: int = 0
    elastic_count: int = 0
    virial: float = 0.0
    wall_impulse: tuple[float, ...] = ()
    dissipated_energy: float = 0.0
    largest_overlap: float = 0.0
    unresolved: int = 0

    def __add__(self, other: "ContactReport") -> "ContactReport":
        """Both together."""
        impulses = self.wall_impulse or (0.0,) * len(other.wall_impulse)
        others = other.wall_impulse or (0.0,) * len(impulses)
        return ContactReport(
            pair_count=self.pair_count + other.pair_count,
            wall_count=self.wall_count + other.wall_count,
            elastic_count=self.elastic_count + other.elastic_count,
            virial=self.virial + other.virial,
            wall_impulse=tuple(a + b for a, b in zip(impulses, others, strict=True)),
            dissipated_energy=self.dissipated_energy + other.dissipated_energy,
            largest_overlap=max(self.largest_overlap, other.largest_overlap),
            unresolved=self.unresolved + other.unresolved,
        )


class ContactSolver:
    """What every contact solver offers; it is bound to the spheres of a scene and to their fields.

    drifts   moves the spheres itself, along straight ways, and resolves contacts on the way: `drift`
    flies    moves the spheres itself for any time, without steps: `advance`
    Neither  corrects positions and velocities after a step: `correct`
    """

    drifts = False
    flies = False
    setup: ContactSetup

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Take the spheres, and the State whose position and velocity are to be changed; allocate what is needed."""
        raise NotImplementedError

    def prepare(self, time: float) -> None:
        """Positions and velocities were set from outside: forget what was known of them."""

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move every sphere by h along its velocity from `time` on, contacts resolved in the order of time."""
        raise NotImplementedError

    def advance(self, time: float, span: float) -> None:
        """Go on from `time` to time + span."""
        raise NotImplementedError

    def correct(self, state: Any, time: float) -> None:
        """Resolve the contacts that there are at `time`."""
        raise NotImplementedError

    def collect(self) -> ContactReport:
        """What was counted since the last call."""
        raise NotImplementedError

    def destroy(self) -> None:
        """Give the memory back."""
        raise NotImplementedError

    def failure(self, count: int) -> str:
        """What to say of contacts that were given up on, and what would help."""
        return f"{count} contacts could not be resolved; try a smaller dt, or a contact_time that makes quick bounces elastic"

    @property
    def conserves_energy(self) -> bool:
        """Whether contacts keep the kinetic energy: nothing is inelastic, and no wall moves."""
        elastic = bool((self.setup.restitution == 1.0).all())
        return elastic and self.gains_no_energy and all(wall.restitution == 1.0 for wall in self.setup.enclosure.surfaces)

    @property
    def gains_no_energy(self) -> bool:
        """Whether contacts cannot add energy: no wall moves."""
        return not any(any(wall.velocity) for wall in self.setup.enclosure.surfaces)
