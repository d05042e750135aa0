"""Coulomb force between all charges."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import is_not_zero, parameter, where, wide_number
from mpp_taichi.component import Groups, component, param
from mpp_taichi.forces._inverse_square import InverseSquareForce
from mpp_taichi.types import Template


@component
class Coulomb(InverseSquareForce):
    """Softened Coulomb force, F_i = −k q_i Σ_j q_j d / (|d|² + ε²)^(3/2) with d = x_j − x_i.

    Equal signs repel. A charged particle must have a mass. Source: Jackson, Classical Electrodynamics (1999), §1.1.
    """

    coulomb_constant: float = param(
        1.0, strength=True, slider=True, unit="force length² charge⁻²", help="Coulomb's constant k = 1/(4πε₀)"
    )
    softening: float = param(0.0, minimum=0.0, unit="length", help="ε, the radius inside which the force is softened")
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    needs = frozenset({"charge", "mass"})
    has_derivatives = True
    proportional_to_charge = True
    singular_at_zero_distance = True
    takes_any_numbers = True

    @ti.func
    def response(self, state: Template, i):
        """Charge over mass, −k q_i / m_i, and 0 for a neutral particle even where it has no mass."""
        ratio = -parameter(state, self.coulomb_constant) * state.charge[i] / state.mass[i]
        return where(is_not_zero(state.charge[i]), ratio, 0.0)

    @ti.func
    def source(self, state: Template, j):
        """q_j."""
        return state.charge[j]

    @ti.func
    def potential(self, state: Template, i, j, inverse_distance):
        """Energy k q_i q_j / ρ."""
        k = wide_number(state, parameter(state, self.coulomb_constant))
        return k * wide_number(state, state.charge[i]) * wide_number(state, state.charge[j]) * inverse_distance
