"""Measured frequency of a mode of the springs against theory."""

from mpp_taichi.component import Lattice, ModeNumbers, component, param
from mpp_taichi.diagnostics._modes import OfMode
from mpp_taichi.quantities._base import NoResultError


@component
class ModeFrequencyError(OfMode):
    """Relative error of a mode's frequency, ω / ω_theory − 1.

    Theory is lattice theory where the springs form a lattice with its ends or its rim held, and the network's own matrix
    otherwise; both describe small vibrations without friction, and do not depend on the time step.
    """

    of: Lattice = param(None, optional=True, help="a lattice; absent: the mode is counted in the whole network")
    mode: ModeNumbers = param(help="[r, s] of a lattice, [k] from below of a network")
    along: str = param(None, optional=True, choices=("x", "y", "z"), help="direction of the motion; absent: across the lattice")
    after: float = param(None, optional=True, minimum=0.0, unit="time", help="time of the first sample; absent: the start")

    def result(self) -> float:
        """ω / ω_theory − 1."""
        if self.theory == 0.0:
            raise NoResultError(f"mode {self.label} has no frequency by theory: slack springs pull back by a³")
        return self.measured().angular_frequency / self.theory - 1.0
