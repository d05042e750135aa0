"""The error of the total energy."""

from mpp_taichi.component import component
from mpp_taichi.energy.energy_error import EnergyError
from mpp_taichi.energy.mechanics import kinetic_energies, total
from mpp_taichi.quantities._base import Quantity, RunSample, Setting


@component
class RelativeEnergyError(Quantity):
    """Change of the total energy since the start, or since the last change of a timeline, |E − E₀| / |E₀|.

    Where E₀ is zero, over the largest kinetic + |potential| energy seen so far.
    """

    remembers = True

    def begin(self, setting: Setting) -> None:
        """Begin without a sample."""
        self.restart()

    def restart(self) -> None:
        """Forget the energy at the start."""
        self._error = EnergyError()

    def label(self, setting: Setting) -> str:
        """Relative energy error."""
        return "relative energy error"

    def measure(self, sample: RunSample) -> float:
        """The error."""
        kinetic = total(kinetic_energies(sample.snapshot))
        began = sample.phase_energy
        return self._error.see(kinetic, sample.potential_energy, phase_number=sample.phase_number, phase_energy=began)
