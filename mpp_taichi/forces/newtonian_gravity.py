"""Newtonian gravity between all particles."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.component import Groups, component, param
from mpp_taichi.forces._inverse_square import InverseSquareForce
from mpp_taichi.types import Template


@component
class NewtonianGravity(InverseSquareForce):
    """Newtonian gravity, a_i = G Σ_j m_j d / (|d|² + ε²)^(3/2) with d = x_j − x_i.

    With ε > 0 this is exactly the force of the potential −G m_i m_j / √(|d|² + ε²), Plummer's sphere. Massless particles
    are attracted and attract no particle. The solver `direct` sums over all pairs, O(N²); `tree` takes far bodies together, O(N
    log N). For 99 % of the particles its error is below `accuracy` |a_i| + r Σ_j |a_ij|, with the acceleration a_ij that
    particle j causes, and round-off r = 2·10⁻⁶ in f32 and 4·10⁻¹⁵ in f64 (docs/gravity.md).

    Source: Newton 1687; Plummer, MNRAS 71 (1911) 460.
    """

    strength: float = param(
        None,
        optional=True,
        strength=True,
        slider=True,
        unit="length³ mass⁻¹ time⁻²",
        help="G, or k² in Gaussian units; absent: the G of the scene's units, or 1",
    )
    softening: float = param(0.0, minimum=0.0, unit="length", help="ε, the radius inside which gravity is softened")
    solver: str = param(
        "direct", choices=("direct", "tree"), help="sum over all pairs, or a tree that takes far bodies together"
    )
    accuracy: float = param(
        None,
        optional=True,
        minimum=1e-6,
        maximum=0.1,
        help="only for tree: relative error of the force that 99 % of the particles keep; absent: 1e-3",
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    needs = frozenset({"mass"})
    has_derivatives = True
    gravitates = True
    can_use_tree = True
    proportional_to_mass = True
    singular_at_zero_distance = True
    takes_any_numbers = True

    @ti.func
    def response(self, state: Template, i):
        """G."""
        return parameter(state, self.strength)

    @ti.func
    def source(self, state: Template, j):
        """m_j."""
        return state.mass[j]

    @ti.func
    def potential(self, state: Template, i, j, inverse_distance):
        """−G m_i m_j / ρ."""
        strength = wide_number(state, parameter(state, self.strength))
        return -strength * wide_number(state, state.mass[i]) * wide_number(state, state.mass[j]) * inverse_distance
