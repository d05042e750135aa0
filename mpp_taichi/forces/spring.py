"""Damped springs between linked particles."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import is_above_zero, root, where, wide_number
from mpp_taichi.arithmetic.particle_update import approach, separation, wide_position, wide_velocity
from mpp_taichi.component import component, param
from mpp_taichi.forces._base import BondForce
from mpp_taichi.types import Template


@component
class Spring(BondForce):
    """Damped spring, F_i = D (|d| − L) n + c (v_j − v_i)·n n with d = x_j − x_i, n = d/|d|.

    `full` damping is MPPhys' c (v_j − v_i), which also brakes rigid rotation. (Eq. 4 of the MPPhys paper has the sign of the
    bracket reversed; as printed a stretched spring repels.) Explicit steps need dt < 2/ω_max, ω_max² ≤ max_i Σ 2D/m_i.
    A spring whose ends coincide has no direction and exerts no elastic force. Source: Hooke; T. Müller, arXiv:1403.1695.
    """

    damping: str = param(
        "axial", choices=("axial", "full", "none"), help="direction in which c acts; none where no spring has damping"
    )
    has_derivatives = True
    acts_on_springs = True
    takes_any_numbers = True

    @property
    def needs(self) -> frozenset:
        """The half-spring arrays; `spring_damping` only where some spring has damping."""
        base = frozenset({"mass", "spring_start", "spring_neighbor", "spring_stiffness", "spring_rest_length"})
        return base | {"spring_damping"} if self.depends_on_velocity else base

    @property
    def depends_on_velocity(self) -> bool:
        """Whether any spring is damped."""
        return self.damping != "none"

    @property
    def conserves_energy(self) -> bool:
        """Only without damping."""
        return self.damping == "none"

    @property
    def fits_slices(self) -> bool:
        """Unless damping acts across the axis as well."""
        return self.damping != "full"

    @ti.func
    def force(self, state: Template, i, j, h):
        """Force on particle i from the half-spring h that leads to j.

        One division, D (|d| − L)/|d| or with axial damping (D (|d| − L) |d| + c (v_j − v_i)·d)/d², and no branch: compilers
        make vectors of several half-springs only without.
        """
        d = separation(state, i, j)
        squared = d.dot(d)
        length = root(squared)
        tension = state.spring_stiffness[h] * (length - state.spring_rest_length[h])
        along = tension / length
        if ti.static(self.damping == "axial"):
            closing = approach(state, i, j).dot(d)
            along = (tension * length + state.spring_damping[h] * closing) / squared
        result = where(is_above_zero(squared), along, 0.0) * d
        if ti.static(self.damping == "full"):
            result += state.spring_damping[h] * approach(state, i, j)
        return result

    @ti.func
    def friction(self, state: Template, i, j, h):
        """c (v_j − v_i)·n n, or c (v_j − v_i) where damping is full."""
        u = approach(state, i, j)
        result = state.spring_damping[h] * u
        if ti.static(self.damping == "axial"):
            d = separation(state, i, j)
            squared = d.dot(d)
            along = state.spring_damping[h] * u.dot(d) / squared
            result = where(is_above_zero(squared), along, 0.0) * d
        return result

    @ti.func
    def shape(self, state: Template, h, inverse_distance):
        """D (1 − L/|d|)."""
        return state.spring_stiffness[h] * (1.0 - state.spring_rest_length[h] * inverse_distance)

    @ti.func
    def slope(self, state: Template, h, inverse_distance):
        """−D L, with no curvature."""
        return -state.spring_stiffness[h] * state.spring_rest_length[h]

    @ti.func
    def stiffness(self, state: Template, i, j, h, length):
        """D along, D (1 − L/|d|) across: less than nothing where the spring is compressed. Without a direction, D all round."""
        along = state.spring_stiffness[h]
        across = along
        if length > 0.0:
            across = along * (1.0 - state.spring_rest_length[h] / length)
        return along, across

    @ti.func
    def step_force(self, state: Template, i, j, h):
        """D (½ (l₀ + l₁) − L) (d₀ + d₁)/(l₀ + l₁), whose product with d₁ − d₀ is ½ D (l₁ − L)² − ½ D (l₀ − L)².

        Source: Simo & Tarnow, Z. angew. Math. Phys. 43 (1992) 757; Gonzalez, J. Nonlinear Sci. 6 (1996) 449.
        """
        d = separation(state, i, j)
        before, after = self.step_lengths(state, i, j)
        result = ti.Vector.zero(float, state.dimensions)
        if before + after > 0.0:
            result = state.spring_stiffness[h] * (1.0 - 2.0 * state.spring_rest_length[h] / (before + after)) * d
        if ti.static(self.damping == "axial"):
            squared = d.dot(d)
            if squared > 0.0:
                closing = approach(state, i, j).dot(d)
                result += state.spring_damping[h] * (closing / squared) * d
        if ti.static(self.damping == "full"):
            result += state.spring_damping[h] * approach(state, i, j)
        return result

    @ti.func
    def step_stiffness(self, state: Template, i, j, h, length):
        """Stiffness over the step, as if the spring did not turn during the step."""
        before, after = self.step_lengths(state, i, j)
        across = state.spring_stiffness[h]
        along = across
        if before + after > 0.0:
            share = 2.0 * state.spring_rest_length[h] / (before + after)
            across = state.spring_stiffness[h] * (1.0 - share)
            along = across + state.spring_stiffness[h] * share * (2.0 * length / (before + after))
        return along, across

    @ti.func
    def damping_rates(self, state: Template, h):
        """c along; across nothing, or c again when damping is full."""
        along = ti.cast(0.0, float)
        across = ti.cast(0.0, float)
        if ti.static(self.damping != "none"):
            along = state.spring_damping[h]
        if ti.static(self.damping == "full"):
            across = state.spring_damping[h]
        return along, across

    @ti.func
    def potential(self, state: Template, i, j, h):
        """½ D (|d| − L)²."""
        d = wide_position(state, j) - wide_position(state, i)
        stretch = ti.sqrt(d.dot(d)) - wide_number(state, state.spring_rest_length[h])
        return 0.5 * wide_number(state, state.spring_stiffness[h]) * stretch * stretch

    @ti.func
    def dissipation(self, state: Template, i, j, h):
        """c ((v_j − v_i)·n)², or c |v_j − v_i|² with full damping."""
        d = wide_position(state, j) - wide_position(state, i)
        u = wide_velocity(state, j) - wide_velocity(state, i)
        squared, along, speed = d.dot(d), d.dot(u), u.dot(u)
        if ti.static(self.damping == "axial"):
            speed = ti.select(squared > 0.0, along * along / squared, 0.0)
        return wide_number(state, state.spring_damping[h]) * speed
