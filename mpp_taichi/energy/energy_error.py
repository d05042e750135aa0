"""The relative error of a conserved energy: the only definition of the ratio and of an energy that counts as zero."""

import math

ZERO_ENERGY = 1e-12  # an |E₀| below this share of kinetic + |potential| is zero but for rounding


class EnergyError:
    """|E − E₀| / |E₀| along a run, E₀ the energy at the start of the present phase.

    Where E₀ is zero, the change is divided by the largest kinetic + |potential| energy so far.
    """

    def __init__(self) -> None:
        """Start without a sample."""
        self._phase_number: int | None = None
        self._start = 0.0
        self.largest = 0.0  # kinetic + |potential| since the phase was first seen

    def see(self, kinetic: float, potential: float, *, phase_number: int, phase_energy: float | None) -> float:
        """Take a sample and return its error; `phase_energy` is that at the start of the phase, None in the first phase."""
        energy = kinetic + potential
        if phase_number != self._phase_number:
            began = None if self._phase_number is None else phase_energy
            self._phase_number, self._start, self.largest = phase_number, energy if began is None else began, 0.0
        self.largest = max(self.largest, kinetic + abs(potential))
        return relative_error(energy - self._start, self._start, self.largest)


def relative_error(change: float, start: float, largest: float) -> float:
    """|change| / |E₀| of an energy that was E₀ at the start; over the largest kinetic + |potential| where E₀ is zero."""
    return ratio(change, scale_of(start, largest))


def scale_of(start: float, largest: float) -> float:
    """|start|, or the largest value where |start| is no more than its rounding error."""
    return abs(start) if abs(start) > ZERO_ENERGY * largest else largest


def ratio(change: float, scale: float) -> float:
    """|change| / scale; 0 where both are 0."""
    size = abs(change)
    return size / scale if scale > 0.0 else (0.0 if size == 0.0 else math.inf)
