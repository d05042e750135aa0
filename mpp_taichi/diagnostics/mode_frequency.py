"""Measured frequency of a mode of the springs."""

from mpp_taichi.component import Lattice, ModeNumbers, component, param
from mpp_taichi.diagnostics._modes import OfMode


@component
class ModeFrequency(OfMode):
    """Angular frequency of a mode [radians time⁻¹], from the times at which its amplitude goes through zero.

    The amplitude is the projection of the displacement from rest, a = Σ m shape · u / Σ m shape².
    """

    of: Lattice = param(None, optional=True, help="a lattice; absent: the mode is counted in the whole network")
    mode: ModeNumbers = param(help="[r, s] of a lattice, [k] from below of a network")
    along: str = param(None, optional=True, choices=("x", "y", "z"), help="direction of the motion; absent: across the lattice")
    after: float = param(None, optional=True, minimum=0.0, unit="time", help="time of the first sample; absent: the start")

    def result(self) -> float:
        """ω."""
        return self.measured().angular_frequency
