"""Forces whose law is a formula: the programs of formulas/ inside the loops of every other force."""

from collections.abc import Mapping
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import (
    components,
    is_not_zero,
    parameter,
    vector_of,
    where,
    wide_number,
    zero_vector,
)
from mpp_taichi.arithmetic.formula_steps import KernelArithmetic, number_like
from mpp_taichi.arithmetic.kernel_number import KernelNumber
from mpp_taichi.arithmetic.particle_update import position_seen, velocity_seen, wide_position
from mpp_taichi.arithmetic.traced import entry_of, traced
from mpp_taichi.forces._base import ExternalForce, PairForce, felt, felt_vector
from mpp_taichi.scene.formulas.external_law import MOTION, PLACE, PUSH, ExternalLaw
from mpp_taichi.scene.formulas.pair_law import QUANTITIES, PairLaw


class FormulaPair(PairForce):
    """A pair force whose potential is a formula of the distance."""

    is_formula = True
    singular_at_zero_distance = True
    takes_any_numbers = True
    law: PairLaw
    live: Mapping[str, str]

    @property
    def takes_lanes(self) -> bool:
        """Whether g only multiplies numbers that are the same for all lanes."""
        return self.law.shape.takes_lanes and not self.live

    @property
    def derivatives_take_lanes(self) -> bool:
        """Whether the derivatives of g do so too."""
        return self.takes_lanes and self.law.slope.takes_lanes and self.law.curvature.takes_lanes

    @property
    def reach(self) -> float:
        """The cutoff, where it is a fixed number."""
        return self.law.fixed_reach

    @traced
    def response(self, state: Any, i: Any) -> Any:
        """A_i/m_i, and 0 for a neutral particle where A is 0 without a charge."""
        result = self._of_particle(self.law.response, state, i)
        if not self.proportional_to_charge:
            return result
        return where(is_not_zero(entry_of(state.charge, i)), result, 0.0)

    @traced
    def source(self, state: Any, j: Any) -> Any:
        """A_j."""
        return self._of_particle(self.law.source, state, j)

    @traced
    def shape(self, inverse_distance: Any) -> Any:
        """g = U′(r)/r."""
        return self._of_distance(self.law.shape, inverse_distance)

    @traced
    def slope(self, inverse_distance: Any) -> Any:
        """dg/du."""
        return self._of_distance(self.law.slope, inverse_distance)

    @traced
    def curvature(self, inverse_distance: Any) -> Any:
        """d²g/du²."""
        return self._of_distance(self.law.curvature, inverse_distance)

    @traced
    def potential(self, state: Any, i: Any, j: Any, inverse_distance: Any) -> Any:
        """Energy A_i A_j U of the pair."""
        ends = [wide_number(state, self.source(state, each)) for each in (i, j)]
        live = {name: wide_number(state, parameter(state, getattr(self, at))) for name, at in self.live.items()}
        values = {"u": inverse_distance, **live}
        alone = self.law.energy.run(KernelArithmetic, values, inverse_distance)[0]
        return ends[0] * ends[1] * alone

    def _of_distance(self, program: Any, u: Any) -> Any:
        values = {"u": u, **{name: number_like(getattr(self, at), u) for name, at in self.live.items()}}
        return program.run(KernelArithmetic, values, u)[0]

    def _of_particle(self, program: Any, state: Any, i: Any) -> Any:
        values = {name: entry_of(getattr(state, QUANTITIES[name]), i) for name in program.names if name in QUANTITIES}
        values |= {name: parameter(state, getattr(self, at)) for name, at in self.live.items()}
        one = parameter(state, 1.0)
        result = program.run(KernelArithmetic, values, one)[0]
        return one * result if isinstance(result, float) else result


class FormulaField(ExternalForce):
    """A force on each particle by a formula of its place, velocity and time.

    A formula of the package is written for three axes; in two dimensions z and v_z are 0.
    """

    is_formula = True
    may_give_energy = True  # where the formula has velocities
    takes_any_numbers = True
    on: tuple[int, int] | None = None
    law: ExternalLaw
    live: Mapping[str, str]

    @traced
    def accelerate(self, state: Any, i: Any, velocity: Any, time: Any) -> Any:
        """The acceleration of particle i."""
        return self._vector(state, i, self.law.acceleration, self._values(state, i, velocity, time))

    @traced
    def derivatives(self, state: Any, i: Any, time: Any) -> Any:
        """First and second derivative of the acceleration along the motion."""
        values = self._values(state, i, velocity_seen(state, i), time)
        jerk = self._vector(state, i, self.law.jerk, values)
        if not hasattr(state, "estimate"):  # of a method that sums no snaps
            return [jerk, zero_vector(state)]
        push = entry_of(state.estimate, i)
        values |= dict.fromkeys(PUSH[state.dimensions :], parameter(state, 0.0))
        values |= dict(zip(PUSH, components(push, state.dimensions)))
        return [jerk, self._vector(state, i, self.law.snap, values)]

    @traced
    def potential(self, state: Any, i: Any, time: Any) -> Any:
        """V of particle i."""
        place = wide_position(state, i)
        values = dict.fromkeys(PLACE, ti.cast(0.0, state.wide))
        values |= {name: entry_of(place, k) for k, name in enumerate(PLACE[: state.dimensions])}
        names = set(QUANTITIES) & self.law.energy.names
        values |= {name: wide_number(state, entry_of(getattr(state, QUANTITIES[name]), i)) for name in names}
        values |= {name: wide_number(state, parameter(state, getattr(self, at))) for name, at in self.live.items()}
        energy = ti.cast(self.law.energy.run(KernelArithmetic, values, 0.0)[0], state.wide)
        return felt(state, i, self.on, energy)

    def _values(self, state: Any, i: Any, velocity: Any, time: Any) -> dict[str, Any]:
        used = self.law.acceleration.names | self.law.jerk.names | self.law.snap.names
        values = {
            name: number
            for names, vector in ((PLACE, position_seen(state, i)), (MOTION, velocity))
            for name, number in zip(names, components(vector, state.dimensions))
        }
        missing = {*PLACE[state.dimensions :], *MOTION[state.dimensions :]} & used
        values |= {name: parameter(state, 0.0) for name in missing}
        values |= {name: entry_of(getattr(state, QUANTITIES[name]), i) for name in used & set(QUANTITIES)}
        values |= {name: parameter(state, getattr(self, at)) for name, at in self.live.items()}
        kept = state.number_kind is None or isinstance(time, KernelNumber)
        return values | {"t": time if kept else parameter(state, time)}

    def _vector(self, state: Any, i: Any, program: Any, values: Mapping[str, Any]) -> Any:
        one = parameter(state, 1.0)
        found = program.run(KernelArithmetic, values, one)[: state.dimensions]
        numbers = [one * each if isinstance(each, float) else each for each in found]
        return felt_vector(state, i, self.on, vector_of(state, numbers))
