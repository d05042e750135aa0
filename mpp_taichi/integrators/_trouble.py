"""Trouble: why a run cannot go on with the state that its last launch left. Host side; no Taichi."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Trouble:
    """One reason that ends a run, and the particle, step and time of it as far as they are known.

    kind      not_finite   a position or velocity is NaN or infinite
              unsolved     the equations of an implicit step have no solution that Newton's method found
              stalled      an adaptive method asks for a step that is too short for the time to change
              bent         the length of a rod, from `particle` to `other`, cannot be kept
              lost         Kepler's equation of an orbit was not solved
              off_lattice  a coordinate is beyond the end of the lattice of a method of integers
    particle  index over all replicas
    steps     for unsolved and bent: how many steps of the launch every replica did solve
    time      for stalled: where the last step ended [time]
    singular  for bent: other rods fix the length of the rod already
    reason    for off_lattice: the rest of the sentence that begins with the particle's name
    """

    kind: str
    particle: int
    steps: int = 0
    time: float = 0.0
    reason: str = ""
    other: int = -1
    singular: bool = False

    @property
    def is_located(self) -> bool:
        """Whether the launch itself stopped at the step in question, so that no search for that step is needed."""
        return self.kind in ("unsolved", "stalled", "bent")


def not_finite(particle: int) -> Trouble | None:
    """The trouble of the first particle that is not finite; None for −1, which says that there is no such particle."""
    return Trouble("not_finite", particle) if particle >= 0 else None
