"""Energy of motion."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.energy.mechanics import kinetic_energies, kinetic_of_copies, total
from mpp_taichi.quantities._base import ENERGY, ManySample, OfEach, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class KineticEnergy(OfEach):
    """Kinetic energy ½ Σ m v² of a particle, a group or all [energy]; a histogram shows the energy of each particle."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    dimension = ENERGY
    takes_many = True

    def label(self, setting: Setting) -> str:
        """`kinetic energy of planet`."""
        return of_which("kinetic energy", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The sum."""
        return total(self.each(sample))

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The sum in each copy."""
        return kinetic_of_copies(many.snapshot, rows(self.of))

    def each(self, sample: RunSample) -> np.ndarray:
        """The terms."""
        return kinetic_energies(sample.snapshot, rows(self.of))
