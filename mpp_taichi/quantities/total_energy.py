"""Energy of motion and position."""

import numpy as np

from mpp_taichi.component import component
from mpp_taichi.energy.mechanics import kinetic_energies, kinetic_of_copies, total
from mpp_taichi.quantities._base import ENERGY, ManySample, Quantity, RunSample, Setting


@component
class TotalEnergy(Quantity):
    """Kinetic and potential energy of all particles [energy]."""

    dimension = ENERGY
    takes_many = True

    def label(self, setting: Setting) -> str:
        """Total energy."""
        return "total energy"

    def measure(self, sample: RunSample) -> float:
        """The sum."""
        return total(kinetic_energies(sample.snapshot)) + sample.potential_energy

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The sum in each copy."""
        return kinetic_of_copies(many.snapshot) + many.potential_energy
