"""Energy that left a mode of the springs."""

from mpp_taichi.component import Lattice, ModeNumbers, component, param
from mpp_taichi.diagnostics._modes import OfMode
from mpp_taichi.modes.mode_set import ModeReading
from mpp_taichi.quantities._base import NoResultError


@component
class ModeLeakage(OfMode):
    """Largest share of the energy outside a mode in any sample, 1 − ½ M (ȧ² + ω² a²) / (½ Σ m v² + ½ uᵀ K u).

    Energies are computed with the springs linearised at rest, M = Σ m shape².
    """

    of: Lattice = param(None, optional=True, help="a lattice; absent: the mode is counted in the whole network")
    mode: ModeNumbers = param(help="[r, s] of a lattice, [k] from below of a network")
    along: str = param(None, optional=True, choices=("x", "y", "z"), help="direction of the motion; absent: across the lattice")
    after: float = param(None, optional=True, minimum=0.0, unit="time", help="time of the first sample; absent: the start")
    _leaked: float | None = None

    def compare(self, reading: ModeReading) -> None:
        """Compare the energies."""
        if reading.total_energy > 0.0:
            self._leaked = max(self._leaked or 0.0, 1.0 - float(reading.share[0]))

    def result(self) -> float:
        """The share."""
        if self._leaked is None:
            raise NoResultError("the springs never moved from rest")
        return self._leaked
