"""Energy of position."""

from mpp_taichi.component import component
from mpp_taichi.quantities._base import ENERGY, Quantity, RunSample, Setting


@component
class PotentialEnergy(Quantity):
    """Potential energy of all particles [energy]: of every force and spring that has one."""

    dimension = ENERGY

    def label(self, setting: Setting) -> str:
        """Potential energy."""
        return "potential energy"

    def measure(self, sample: RunSample) -> float:
        """The sum over all forces."""
        return sample.potential_energy
