"""Energy of motion."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.energy.mechanics import kinetic_energies, total
from mpp_taichi.quantities._base import ENERGY, Look, OfEach, Setting, of_which, rows


@component
class KineticEnergy(OfEach):
    """Kinetic energy ½ Σ m v² of a particle, a group or all [energy]; in a histogram that of each particle."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    dimension = ENERGY

    def label(self, setting: Setting) -> str:
        """Of what."""
        return of_which("kinetic energy", setting.name_of(self.of))

    def measure(self, look: Look) -> float:
        """The sum."""
        return total(self.each(look))

    def each(self, look: Look) -> np.ndarray:
        """The terms."""
        return kinetic_energies(look.snapshot, rows(self.of))
