"""Pair forces between two groups of particles, as forces between all pairs of which some have the factor 0.

A pair (i, j) acts if i is in A and j in B, or j in A and i in B: with 1_A(i) = 1 in A and 0 elsewhere, and C = A ∩ B,

    1_A(i) 1_B(j) + 1_B(i) 1_A(j) − 1_C(i) 1_C(j).

Each term is a response times a source, so that every loop over pairs takes it, whatever its numbers are.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import where
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.forces._base import PairForce, is_in
from mpp_taichi.neighbors._pair_groups import derivatives_take_lanes, takes_lanes
from mpp_taichi.scene.groups import Group, shares


def parts_of(force: Any) -> list[Any]:
    """The forces that a loop over pairs sums for this force: the force itself, or its terms where it acts between groups."""
    between = getattr(force, "between", None)
    if between is None:
        return [force]
    return [GroupedForce(force, *term, tells_energy=k == 0) for k, term in enumerate(shares(*between))]


class GroupedForce(PairForce):
    """One term of a force between two groups."""

    def __init__(self, force: Any, responds: Group, acts: Group, sign: float, *, tells_energy: bool) -> None:
        """Particles of the group `responds` feel those of the group `acts`; one of the terms has the energy of all pairs."""
        self.force, self.responds, self.acts, self.sign, self.tells_energy = force, responds, acts, sign, tells_energy
        for name in ("needs", "softening", "reach", "takes_any_numbers", "takes_low_parts", "has_functions", "has_derivatives"):
            setattr(self, name, getattr(force, name))
        self.takes_lanes, self.derivatives_take_lanes = takes_lanes(force), derivatives_take_lanes(force)

    @traced
    def response(self, state: Any, i: Any) -> Any:
        """The response of particle i, and 0 outside of its group."""
        return where(is_in(state, i, self.responds), self.force.response(state, i), 0.0)

    @traced
    def source(self, state: Any, j: Any) -> Any:
        """The source of particle j, and 0 outside of its group."""
        source = self.force.source(state, j)
        return where(is_in(state, j, self.acts), source if self.sign > 0.0 else -1.0 * source, 0.0)

    @traced
    def shape(self, inverse_distance: Any) -> Any:
        """The shape of the force."""
        return self.force.shape(inverse_distance)

    @traced
    def slope(self, inverse_distance: Any) -> Any:
        """The slope of the force."""
        return self.force.slope(inverse_distance)

    @traced
    def curvature(self, inverse_distance: Any) -> Any:
        """The curvature of the force."""
        return self.force.curvature(inverse_distance)

    @traced
    def potential(self, state: Any, i: Any, j: Any, inverse_distance: Any) -> Any:
        """The energy of the pair where it acts, in one of the terms."""
        if not self.tells_energy:
            return ti.cast(0.0, state.wide)
        first, second = self.force.between
        one = is_in(state, i, first) & is_in(state, j, second)
        other = is_in(state, i, second) & is_in(state, j, first)
        return ti.select(one | other, self.force.potential(state, i, j, inverse_distance), 0.0)
