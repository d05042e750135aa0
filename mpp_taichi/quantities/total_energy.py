"""Energy of motion and position."""

from mpp_taichi.component import component
from mpp_taichi.energy.mechanics import kinetic_energies, total
from mpp_taichi.quantities._base import ENERGY, Quantity, RunSample, Setting


@component
class TotalEnergy(Quantity):
    """Kinetic and potential energy of all particles [energy]."""

    dimension = ENERGY

    def label(self, setting: Setting) -> str:
        """Total energy."""
        return "total energy"

    def measure(self, sample: RunSample) -> float:
        """The sum."""
        return total(kinetic_energies(sample.snapshot)) + sample.potential_energy
