"""Forces that fall off with the square of the distance."""

import taichi as ti

from mpp_taichi.forces._base import PairForce


class InverseSquareForce(PairForce):
    """A pair force d/ρ³, ρ the softened distance: the shape g(u) = u³ of u = 1/ρ, and its derivatives."""

    @ti.func
    def shape(self, inverse_distance):
        """g = u³ = 1/ρ³."""
        return inverse_distance * inverse_distance * inverse_distance

    @ti.func
    def slope(self, inverse_distance):
        """dg/du = 3 u² = 3/ρ²."""
        return 3.0 * inverse_distance * inverse_distance

    @ti.func
    def curvature(self, inverse_distance):
        """d²g/du² = 6 u = 6/ρ."""
        return 6.0 * inverse_distance
