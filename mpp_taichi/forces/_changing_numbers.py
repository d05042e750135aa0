"""Changing numbers: masses and charges of bodies that are given functions of the time.

    m(t) = m f(t),  q(t) = q g(t),  dv/dt = F/m(t)
    P = Σ_b [(½ v_b² + ∂U/∂m_b) m_b′ + (∂U/∂q_b) q_b′]

The mass that a body loses leaves with the velocity of the body, so that there is no recoil. P is the power with which the
change of the numbers changes the energy; ∂U/∂m and ∂U/∂q are differences of fourth order, which are exact for potentials that
are polynomials of mass and charge up to the fourth degree, as those of gravity and of charges are.
"""

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.formula_steps import KernelArithmetic
from mpp_taichi.arithmetic.inverse_distance import inverse_distance
from mpp_taichi.arithmetic.particle_update import wide_position, wide_velocity
from mpp_taichi.arithmetic.point_lookup import provide
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.neighbors._pair_groups import grouped
from mpp_taichi.scene.changing_numbers import Change
from mpp_taichi.scene.formulas.path_law import TIME
from mpp_taichi.scene.formulas.program import points_of
from mpp_taichi.types import Template

SHIFT = 0.02
"""Of a mass or a charge: the change for which the energy is compared. Its fourth power is the error of the power where a
formula of a force is no polynomial of mass and charge; the rounding error of an energy, divided by it, that of a polynomial."""


@ti.data_oriented
class ChangingNumbers:
    """Changes of masses and charges as a part of the kernels of a step."""

    def __init__(self, changes: Sequence[Change], snapshot: Any) -> None:
        """Take the changes, and the masses and charges of all particles."""
        self.changes, self.count = tuple(changes), len(changes)
        self.bodies = tuple(dict.fromkeys(change.index for change in changes))
        self.needs = frozenset({"mass", *(change.quantity for change in changes)})
        self._numbers = {name: np.asarray(getattr(snapshot, name), float) for name in ("mass", "charge")}
        self._shifted: dict[int, Any] = {}  # by the identity of a state: a copy of it with masses and charges of its own
        for change in changes:
            provide(points_of(change.law))

    @traced
    def value(self, state: Any, c: int, time: Any) -> Any:
        """The number of change c at a time."""
        return parameter(state, self._found(c, time)[0])

    @traced
    def rate(self, state: Any, c: int, time: Any) -> Any:
        """The derivative of the number of change c."""
        return parameter(state, self._found(c, time)[1])

    def _found(self, c: int, time: Any) -> list[Any]:
        change = self.changes[c]
        return [change.number * each for each in change.law.motion.run(KernelArithmetic, {TIME: time}, 1.0)]

    @ti.func
    def put(self, state: Template, first, time):
        """Give the bodies of the copy that begins at particle `first` their masses and charges of this time."""
        for c in ti.static(range(self.count)):
            i = first + ti.static(self.changes[c].index)
            if ti.static(self.changes[c].quantity == "mass"):
                state.mass[i] = self.value(state, c, time)
            else:
                state.charge[i] = self.value(state, c, time)

    @ti.kernel
    def settle(self, state: Template, time: float):
        """Put the numbers of a time before something is measured or a step is prepared."""
        self.put(state, 0, time)

    @ti.func
    def power(self, state: Template, total_force: Template, time):
        """Power with which the changes change the energy of the first copy [energy / time], in the widest float."""
        h = self.span(state, time)
        result = ti.cast(0.0, state.wide)
        for weight, shift in ti.static(((1.0, -2.0), (-8.0, -1.0), (8.0, 1.0), (-1.0, 2.0))):
            result += weight * self.energy_shifted(state, self.shifted(state), total_force, time, shift * h)
        return result / (12.0 * h)

    @ti.func
    def span(self, state: Template, time):
        """The time in which the number that changes fastest changes by `SHIFT`."""
        fastest = ti.cast(1e-30, state.wide)
        for c in ti.static(range(self.count)):
            now = wide_number(state, self.value(state, c, time))
            size = ti.max(ti.abs(now), ti.static(abs(self.changes[c].number)))
            fastest = ti.max(fastest, ti.abs(wide_number(state, self.rate(state, c, time))) / size)
        return ti.min(SHIFT / fastest, 1e12)

    @ti.func
    def energy_shifted(self, state: Template, shifted: Template, total_force: Template, time, ahead):
        """Energy of the bodies, with the numbers that they would have a time `ahead` at their present rates."""
        for c in ti.static(range(self.count)):
            i = ti.static(self.changes[c].index)
            number = wide_number(state, self.value(state, c, time)) + ahead * wide_number(state, self.rate(state, c, time))
            if ti.static(self.changes[c].quantity == "mass"):
                shifted.mass[i] = number
            else:
                shifted.charge[i] = number
        result = ti.cast(0.0, state.wide)
        for b in ti.static(range(len(self.bodies))):
            i = ti.static(self.bodies[b])
            result += 0.5 * shifted.mass[i] * wide_velocity(state, i).norm_sqr()
            for force in ti.static(total_force.external):
                result += force.potential(shifted, i, time)
            if ti.static(total_force.has_pairs):
                for j in range(total_force.particle_count):
                    if j != i and not self.is_earlier(j, b):
                        result += self.pair_energy(shifted, total_force, i, j)
        return result

    @ti.func
    def is_earlier(self, j, b: Template):
        """Whether particle j is one of the first b bodies, whose pairs have been counted."""
        found = False
        for a in ti.static(range(b)):
            found = found or j == ti.static(self.bodies[a])
        return found

    @ti.func
    def pair_energy(self, shifted: Template, total_force: Template, i: Template, j):
        """Potential energy of a pair by all forces."""
        result = ti.cast(0.0, shifted.wide)
        d = wide_position(shifted, j) - wide_position(shifted, i)
        for group in ti.static(grouped(total_force.pair_forces)[1]):
            inverse = inverse_distance(d.dot(d), wide_number(shifted, parameter(shifted, group.softening_squared)))
            for member in ti.static(group.members):
                result += member.force.potential(shifted, i, j, inverse)
        return result

    @traced
    def shifted(self, state: Any) -> Any:
        """The state with masses and charges that may be changed to see what the energy would be."""
        return self._shifted[id(state)]

    def bind(self, state: Any) -> None:
        """Allocate the masses and charges of the shifted state; needed before `power` is compiled."""
        kind = np.float32 if state.wide == ti.f32 else np.float64
        other = copy.copy(state)
        for name, numbers in self._numbers.items():
            field = ti.field(state.wide, len(numbers))
            field.from_numpy(numbers.astype(kind))
            setattr(other, name, field)
        self._shifted[id(state)] = other
