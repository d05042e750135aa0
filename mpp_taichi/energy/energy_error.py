"""How far the energy is from where it should have stayed."""

import math

ZERO_ENERGY = 1e-12  # an |E₀| below this share of kinetic + |potential| is what rounding left of zero


class EnergyError:
    """|E − E₀| / |E₀| along a run, E₀ that at the start of the present phase; where E₀ is zero, over the largest
    kinetic + |potential| seen so far instead.
    """

    def __init__(self) -> None:
        """Nothing was seen yet."""
        self._phase_number: int | None = None
        self._start = 0.0
        self.largest = 0.0  # kinetic + |potential| since the phase was first seen

    def see(self, kinetic: float, potential: float, *, phase_number: int, phase_energy: float | None) -> float:
        """The error now; `phase_energy` is what the change that began the phase left, None in the first."""
        energy = kinetic + potential
        if phase_number != self._phase_number:
            began = None if self._phase_number is None else phase_energy
            self._phase_number, self._start, self.largest = phase_number, energy if began is None else began, 0.0
        self.largest = max(self.largest, kinetic + abs(potential))
        scale = abs(self._start)
        return ratio(energy - self._start, scale if scale > ZERO_ENERGY * self.largest else self.largest)


def ratio(change: float, scale: float) -> float:
    """|change| / scale; nothing over nothing is nothing."""
    size = abs(change)
    return size / scale if scale > 0.0 else (0.0 if size == 0.0 else math.inf)
