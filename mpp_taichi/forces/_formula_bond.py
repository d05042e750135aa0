"""Forces along springs whose law is a formula."""

from collections.abc import Mapping
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import is_above_zero, parameter, root, where, wide_number, zero_vector
from mpp_taichi.arithmetic.formula_steps import KernelArithmetic, number_like
from mpp_taichi.arithmetic.particle_update import separation, wide_position
from mpp_taichi.arithmetic.traced import entry_of, traced
from mpp_taichi.forces._base import BondForce, is_in
from mpp_taichi.scene.formulas.bond_law import LENGTH, REST, BondLaw
from mpp_taichi.types import Template

SAME_LENGTH = {ti.f64: 6e-6, ti.f32: 4e-3}
"""Relative change of a length over a step below which the mean force is V′ in the middle, ε^(1/3): the error of V′ is its
square, and as much would the quotient of differences lose to rounding."""


class FormulaBond(BondForce):
    """A bond whose potential is a formula of its length."""

    is_formula = True
    has_curvature = True
    takes_any_numbers = True
    of: tuple[int, int] | None = None
    law: BondLaw
    live: Mapping[str, str]

    @ti.func
    def force(self, state: Template, i, j, h):
        """V′(l) d/l where both ends belong to the group, and 0 for ends that coincide."""
        d = separation(state, i, j)
        return self.pull(state, i, j, h, d.dot(d)) * d

    @traced
    def pull(self, state: Any, i: Any, j: Any, h: Any, squared: Any) -> Any:
        """The factor of d in `force`, from |d|²."""
        found = where(is_above_zero(squared), self._of_length(self.law.shape, state, h, root(squared)), 0.0)
        return self.within(state, i, j, found)

    @traced
    def friction(self, state: Any, i: Any, j: Any, h: Any) -> Any:
        """None."""
        return zero_vector(state)

    @traced
    def shape(self, state: Any, h: Any, inverse_distance: Any) -> Any:
        """g = V′/l."""
        return self._of_length(self.law.shape, state, h, 1.0 / inverse_distance)

    @traced
    def slope(self, state: Any, h: Any, inverse_distance: Any) -> Any:
        """dg/du."""
        return self._of_length(self.law.slope, state, h, inverse_distance, "u")

    @traced
    def curvature(self, state: Any, h: Any, inverse_distance: Any) -> Any:
        """d²g/du²."""
        return self._of_length(self.law.curvature, state, h, inverse_distance, "u")

    @traced
    def stiffness(self, state: Any, i: Any, j: Any, h: Any, length: Any) -> Any:
        """V″ along, V′/l across; without a direction neither."""
        there = length > 0.0
        along = where(there, self._of_length(self.law.along, state, h, length), 0.0)
        across = where(there, self._of_length(self.law.shape, state, h, length), 0.0)
        return self.within(state, i, j, along), self.within(state, i, j, across)

    @ti.func
    def step_force(self, state: Template, i, j, h):
        """2 (V(l₁) − V(l₀))/(l₁² − l₀²) d, whose product with d₁ − d₀ is V(l₁) − V(l₀); d is the mean of d₀ and d₁.

        Source: Gonzalez, J. Nonlinear Sci. 6 (1996) 449.
        """
        return self.step_pull(state, i, j, h) * separation(state, i, j)

    @ti.func
    def step_pull(self, state: Template, i, j, h):
        """The factor of d in `step_force`."""
        before, after = self.step_lengths(state, i, j)
        total = before + after
        result = ti.cast(0.0, float)
        if total > 0.0:
            if ti.abs(after - before) > ti.static(_same_length()) * total:
                gained = self.energy_of(state, h, after) - self.energy_of(state, h, before)
                result = 2.0 * gained / (total * (after - before))
            else:
                result = self.shape(state, h, 2.0 / total)
        return self.within(state, i, j, result)

    @ti.func
    def step_stiffness(self, state: Template, i, j, h, length):
        """V″ along, at the mean length, and the pull across."""
        before, after = self.step_lengths(state, i, j)
        along, _ = self.stiffness(state, i, j, h, 0.5 * (before + after))
        return along, self.step_pull(state, i, j, h)

    @ti.func
    def damping_rates(self, state: Template, h):
        """None."""
        return ti.cast(0.0, float), ti.cast(0.0, float)

    @traced
    def energy_of(self, state: Any, h: Any, length: Any) -> Any:
        """V of a length, in the run's precision."""
        return self._of_length(self.law.energy, state, h, length)

    @traced
    def potential(self, state: Any, i: Any, j: Any, h: Any) -> Any:
        """V of the spring."""
        ends = [wide_position(state, each) for each in (i, j)]
        ways = [entry_of(ends[1], k) - entry_of(ends[0], k) for k in range(state.dimensions)]
        length = ti.sqrt(sum(way * way for way in ways))
        values = {LENGTH: length}
        if REST in self.law.energy.names:
            values[REST] = wide_number(state, entry_of(state.spring_rest_length, h))
        values |= {name: wide_number(state, parameter(state, getattr(self, at))) for name, at in self.live.items()}
        energy = ti.cast(self.law.energy.run(KernelArithmetic, values, length)[0], state.wide)
        return energy if self.of is None else ti.select(self._has_ends(state, i, j), energy, 0.0)

    def _of_length(self, program: Any, state: Any, h: Any, value: Any, name: str = LENGTH) -> Any:
        values = {name: value, **{each: number_like(getattr(self, at), value) for each, at in self.live.items()}}
        if REST in program.names:
            values[REST] = entry_of(state.spring_rest_length, h)
        result = program.run(KernelArithmetic, values, value)[0]
        return result * (value / value) if isinstance(result, float) else result

    @traced
    def within(self, state: Any, i: Any, j: Any, value: Any) -> Any:
        """The value where both ends belong to the group, and 0 elsewhere."""
        return value if self.of is None else where(self._has_ends(state, i, j), value, 0.0)

    def _has_ends(self, state: Any, i: Any, j: Any) -> Any:
        return is_in(state, i, self.of) & is_in(state, j, self.of)


def _same_length() -> float:
    """`SAME_LENGTH` in the precision of the run."""
    return SAME_LENGTH[ti.lang.impl.current_cfg().default_fp]
