"""Energy of position."""

import numpy as np

from mpp_taichi.component import component
from mpp_taichi.quantities._base import ENERGY, ManySample, Quantity, RunSample, Setting


@component
class PotentialEnergy(Quantity):
    """Potential energy of all particles [energy]: of every force and spring that has one."""

    dimension = ENERGY
    takes_many = True

    def label(self, setting: Setting) -> str:
        """Potential energy."""
        return "potential energy"

    def measure(self, sample: RunSample) -> float:
        """The sum over all forces."""
        return sample.potential_energy

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The sum in each copy."""
        return many.potential_energy
