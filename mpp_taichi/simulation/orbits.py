"""The Kepler orbits on which the bodies of a simulation are at one moment."""

from typing import Any

import numpy as np

from mpp_taichi.arithmetic.orbital_elements import Orbit, attraction_between, orbit_of
from mpp_taichi.errors import ArgumentError, PlacementError
from mpp_taichi.scene.layout import layout_of
from mpp_taichi.snapshot import Snapshot


def orbits(self: Any, around: int | str | None = None) -> dict[str | int, Orbit]:
    """The orbit of each body of a simulation now, by its name (`earth`, `ring[3]`), or by its index where it has no name.

    Without `around` the elements are those of Jacobi, as in REBOUND's `sim.orbits()`: each body is around the centre of mass of
    all bodies before it in the scene, with the masses of all of them, so that the first has no orbit. `around` is the name or
    index of a primary body, around which all others are. Bodies that have merged, that no mass attracts or that move along a
    line with the primary are left out. A body that is held along every axis attracts, and is not accelerated itself: around a
    held mass m₁ an orbit has μ = G m₁. Raises ArgumentError without gravity, and where there is no such particle.
    """
    strength, layout = self.spec.gravity, layout_of(self.scene)
    if not strength > 0.0:
        raise ArgumentError("orbits() needs a scene with gravity")
    try:
        primary = None if around is None else layout.find(around)
    except PlacementError as error:
        raise ArgumentError(f"orbits(around={around!r}): {error}") from None
    snapshot = self.snapshot()
    found: dict[str | int, Orbit] = {}
    for index in map(int, np.flatnonzero(snapshot.present)):
        if index != primary and (orbit := _orbit(snapshot, index, primary, strength)) is not None:
            found[layout.name_of(index) or index] = orbit
    return found


def _orbit(snapshot: Snapshot, index: int, primary: int | None, strength: float) -> Orbit | None:
    """The orbit of a particle around another, or around the centre of mass of all before it; None where there is none."""
    others = np.arange(index) if primary is None else np.array([primary])
    others = others[snapshot.present[others]]
    mass = snapshot.mass[others]
    attraction = attraction_between(strength, snapshot, others, np.array([index])) if len(others) else 0.0
    if not (mass.sum() > 0.0 and attraction > 0.0):
        return None
    place, motion = (mass @ values[others] / mass.sum() for values in (snapshot.position, snapshot.velocity))
    try:
        return orbit_of(snapshot.position[index] - place, snapshot.velocity[index] - motion, attraction)
    except ValueError:
        return None
