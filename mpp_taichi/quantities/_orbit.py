"""The orbit of a particle, or of the centre of mass of a group, around another, as several quantities measure it."""

from typing import TYPE_CHECKING

import numpy as np

from mpp_taichi.arithmetic.orbital_elements import Orbit, attraction_between, orbit_of
from mpp_taichi.component import Particles
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import center_of, rows


class OfOrbit(Quantity):
    """An element of the osculating orbit of `of` around `around`; `noun` is its name in a legend."""

    noun: str
    if TYPE_CHECKING:
        of: Particles
        around: Particles

    def begin(self, setting: Setting) -> None:
        """Check that there is gravity, and that the two groups have no particle in common."""
        scenes = (setting.spec, *(event.scene for event in setting.spec.timeline))
        if not any(scene.forces_with("gravitates") for scene in scenes):
            raise NoResultError("an orbit needs gravity, and the scene has no such force")
        if self.of[0] < self.around[0] + self.around[1] and self.around[0] < self.of[0] + self.of[1]:
            raise NoResultError("a body has no orbit around itself: of: and around: have a particle in common")

    def label(self, setting: Setting) -> str:
        """`eccentricity of planet around sun`."""
        return f"{of_which(self.noun, setting.name_of(self.of))} around {setting.name_of(self.around)}"

    def orbit(self, sample: RunSample) -> Orbit:
        """The osculating orbit of two centres of mass, with μ from the masses of both groups, less what is held.

        Raises:
            NoResultError: no mass attracts, a group has merged into other bodies, or the two move along one line.
        """
        snapshot = sample.snapshot
        separation, motion = (
            center_of(values, snapshot, self.of) - center_of(values, snapshot, self.around)
            for values in (snapshot.position, snapshot.velocity)
        )
        every = np.arange(snapshot.particle_count)
        attraction = attraction_between(float(sample.gravity), snapshot, every[rows(self.of)], every[rows(self.around)])
        if not attraction > 0.0:
            raise NoResultError("an orbit needs gravity, and a mass that attracts")
        try:
            return orbit_of(separation, motion, attraction)
        except ValueError as error:
            raise NoResultError(str(error)) from None
