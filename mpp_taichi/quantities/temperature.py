"""Temperature of a gas."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.kinetic_theory.speeds import kinetic_temperature
from mpp_taichi.quantities._base import ENERGY, NoResultError, Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import free_rows


@component
class Temperature(Quantity):
    """Kinetic temperature k T = Σ m v² / (d N) [energy] of particles that are free along every axis."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    drift: bool = param(False, help="whether v is relative to the common motion; d N then becomes d (N − 1)")
    dimension = ENERGY

    def begin(self, setting: Setting) -> None:
        """Find the particles."""
        self._dimensions, self._rows = setting.spec.dimensions, free_rows(self.of, setting.start)
        if len(self._rows) < 1 + self.drift:
            raise NoResultError("there are too few free particles for a temperature")

    def label(self, setting: Setting) -> str:
        """`temperature k T of gas`."""
        return of_which("temperature k T", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """k T."""
        rows = self._rows[sample.snapshot.present[self._rows]]
        if len(rows) < 1 + self.drift:
            raise NoResultError("too few particles have not merged for a temperature")
        velocity, mass = sample.snapshot.velocity[rows], sample.snapshot.mass[rows]
        return float(np.float64(kinetic_temperature(velocity, mass, self._dimensions, drift=self.drift)))
