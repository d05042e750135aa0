"""Energy of motion."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.energy.mechanics import kinetic_energies, total
from mpp_taichi.quantities._base import ENERGY, OfEach, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class KineticEnergy(OfEach):
    """Kinetic energy ½ Σ m v² of a particle, a group or all [energy]; a histogram shows the energy of each particle."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    dimension = ENERGY

    def label(self, setting: Setting) -> str:
        """`kinetic energy of planet`."""
        return of_which("kinetic energy", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The sum."""
        return total(self.each(sample))

    def each(self, sample: RunSample) -> np.ndarray:
        """The terms."""
        return kinetic_energies(sample.snapshot, rows(self.of))
