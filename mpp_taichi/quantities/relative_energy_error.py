"""How well the energy is kept."""

from mpp_taichi.component import component
from mpp_taichi.energy.energy_error import EnergyError
from mpp_taichi.energy.mechanics import kinetic_energies, total
from mpp_taichi.quantities._base import Look, Quantity, Setting


@component
class RelativeEnergyError(Quantity):
    """Change of the total energy since the start, or since the last change of a timeline, |E − E₀| / |E₀|.

    Where E₀ is zero, over the largest kinetic + |potential| energy seen so far.
    """

    def begin(self, setting: Setting) -> None:
        """Nothing was seen yet."""
        self.restart()

    def restart(self) -> None:
        """Begin with another start."""
        self._error = EnergyError()

    def label(self, setting: Setting) -> str:
        """Relative energy error."""
        return "relative energy error"

    def measure(self, look: Look) -> float:
        """The error."""
        kinetic = total(kinetic_energies(look.snapshot))
        began = look.phase_energy
        return self._error.see(kinetic, look.potential_energy, phase_number=look.phase_number, phase_energy=began)
