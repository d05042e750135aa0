"""A harmonic force of torsion between four particles in a row."""

import math

import taichi as ti

from mpp_taichi.arithmetic.elementary_functions import elementary
from mpp_taichi.component import FourInRow, component, param
from mpp_taichi.forces._dihedral import DihedralForce


@component
class Dihedral(DihedralForce):
    """Torsion of a chain: V(φ) = k/2 (φ − φ₀)² of the dihedral angle φ of four particles in a row, about the middle link.

    φ is 0 where the outer particles are on the same side of the middle link (cis), π where they are opposite (trans), and grows
    where the last particle turns about the middle link by the right-hand rule. φ − φ₀ is taken between −π and π; at ±π the
    force jumps from one direction to the other. The middle link must have another direction than either outer link: on a line
    of three particles φ has no value and the force is 0, and near a line it grows as the inverse of the distance from the
    line. The scene must have `dimensions: 3`.
    Source: Blondel & Karplus, J. Comput. Chem. 17 (1996) 1132.
    """

    of: FourInRow = param(help="four particles or groups of one size in their order, or a chain, each four of it in a row")
    stiffness: float = param(strength=True, slider=True, minimum=0.0, unit="energy", help="stiffness k, per square radian")
    angle: float = param(0.0, unit="radian", help="angle φ₀ of no force")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    has_functions = ("atan",)

    @ti.func
    def slope(self, sine, cosine):
        """V′ = k (φ − φ₀)."""
        return self.stiffness * self.twist(sine, cosine)

    @ti.func
    def energy(self, sine, cosine):
        """V = k/2 (φ − φ₀)²."""
        twist = self.twist(sine, cosine)
        return 0.5 * self.stiffness * twist * twist

    @ti.func
    def twist(self, sine, cosine):
        """φ − φ₀ between −π and π.

        An angle up to π/2 is twice the arc tangent of sin/(1 + cos). A larger angle is ±π less the angle with the same sine and
        the opposite cosine, so that 1 + cos is never small.
        """
        s = sine * ti.static(math.cos(self.angle)) - cosine * ti.static(math.sin(self.angle))
        c = cosine * ti.static(math.cos(self.angle)) + sine * ti.static(math.sin(self.angle))
        half = elementary("atan", s / (1.0 + ti.abs(c)))
        opposite = ti.select(s < 0.0, -math.pi, math.pi) - 2.0 * half
        return ti.select(c < 0.0, opposite, 2.0 * half)
