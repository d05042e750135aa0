"""One rigid rod between two particles."""

from collections.abc import Callable

import numpy as np

from mpp_taichi.component import Color, Pair, component, param
from mpp_taichi.networks._base import Network, NetworkContext
from mpp_taichi.snapshot import Rods, Springs


@component
class Rod(Network):
    """One rigid rod without mass: the distance of its two ends keeps the value that it has at the start.

    A rod pulls and pushes with the force that the constant length needs, and does no work. It sets no limit to the step, as a
    stiff spring would. Rods may share particles, as in chains and triangles. Only the methods that are compositions of drifts
    and kicks keep the lengths of rods; the message of another method names them.
    """

    between: Pair = param(help="the particles at the two ends, by index or name")
    color: Color = param((0.75, 0.75, 0.75), help="red, green, blue in 0…1")
    is_rigid = True

    def spring_count(self, lattice: Callable) -> int:
        """None."""
        return 0

    def generate(self, context: NetworkContext) -> Springs:
        """No springs."""
        return Springs()

    def rods(self, position: np.ndarray) -> Rods:
        """The rod, as long as its ends are apart."""
        between = np.array([self.between], dtype=np.int32)
        length = np.linalg.norm(position[between[:, 1]] - position[between[:, 0]], axis=1)
        return Rods(between=between, length=length, color=np.array([self.color], dtype=float))
