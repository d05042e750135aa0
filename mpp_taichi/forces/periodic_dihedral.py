"""A periodic force of torsion between four particles in a row, as in force fields of molecules."""

import math

import taichi as ti

from mpp_taichi.component import FourInRow, component, param
from mpp_taichi.forces._dihedral import DihedralForce


@component
class PeriodicDihedral(DihedralForce):
    """Torsion with several angles of rest: V(φ) = k (1 + cos(n φ − δ)) of the dihedral angle φ of four particles in a row.

    φ is 0 where the outer particles are on the same side of the middle link (cis) and π where they are opposite (trans). The
    potential has n minima and barriers of 2 k between them; a sum of several such forces is a Fourier series, as for butane.
    The middle link must have another direction than either outer link: on a line of three particles φ has no value and the
    force is 0, and near a line it grows as the inverse of the distance from the line. The scene must have `dimensions: 3`.
    Source: Blondel & Karplus, J. Comput. Chem. 17 (1996) 1132; Jorgensen et al., J. Am. Chem. Soc. 118 (1996) 11225.
    """

    of: FourInRow = param(help="four particles or groups of one size in their order, or a chain, each four of it in a row")
    amplitude: float = param(strength=True, slider=True, unit="energy", help="amplitude k, half of the barrier")
    multiplicity: int = param(1, minimum=1, maximum=12, help="number n of minima in a turn")
    phase: float = param(0.0, unit="radian", help="phase δ")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")

    @ti.func
    def slope(self, sine, cosine):
        """V′ = −n k sin(n φ − δ)."""
        s, c = self.multiple(sine, cosine)
        shifted = s * ti.static(math.cos(self.phase)) - c * ti.static(math.sin(self.phase))
        return -self.multiplicity * self.amplitude * shifted

    @ti.func
    def energy(self, sine, cosine):
        """V = k (1 + cos(n φ − δ))."""
        s, c = self.multiple(sine, cosine)
        return self.amplitude * (1.0 + c * ti.static(math.cos(self.phase)) + s * ti.static(math.sin(self.phase)))

    @ti.func
    def multiple(self, sine, cosine):
        """sin n φ and cos n φ, by the sums of angles."""
        s, c = sine, cosine
        for _ in ti.static(range(self.multiplicity - 1)):
            s, c = s * cosine + c * sine, c * cosine - s * sine
        return s, c
