"""Radau deviation: a small change of all positions and velocities, carried through the steps of ias15."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, zero_vector
from mpp_taichi.integrators._radau_growth import RadauGrowth
from mpp_taichi.integrators._radau_polynomial import NODES, TERMS, RadauPolynomial
from mpp_taichi.state.lane_state import PREFIX
from mpp_taichi.state.tangent_meter import RANGE_BITS, TangentMeter
from mpp_taichi.types import Template

LARGE = 2.0 ** (2 * RANGE_BITS)


@ti.data_oriented
class RadauDeviation:
    """The variational equations δa = (∂a/∂x) δx + (∂a/∂v) δv over the steps that the motion takes, by the same polynomials.

    When a step of the motion was accepted, its polynomial stands still, and the polynomial of δ is found by the same iteration:
    at each node the forces are evaluated for dual numbers (arithmetic/dual.py), whose values are the motion at the node, and
    whose changes are δ there. So δ is of order 15 too, the motion keeps its bits, and δ has no part in the choice of steps.
    Source: Rein & Tamayo, Mon. Not. R. Astron. Soc. 459 (2016) 2275, for first-order variations in an adaptive method.
    """

    path = RadauPolynomial(PREFIX)
    memory = (*path.memory, *RadauGrowth.memory)

    def __init__(self, meter: TangentMeter, dual_state: Any, dual_force: Any) -> None:
        """Bind the meter, and the state and the sum of the forces of dual numbers."""
        self.state, self.meter, self.dual_state, self.dual_force = meter.state, meter, dual_state, dual_force
        self.motion, self.growth = RadauPolynomial(), RadauGrowth(meter)

    @classmethod
    def work_fields(cls, particle_count: int) -> dict[str, tuple[str, int]]:
        """The fields, as work fields of the state."""
        return {**cls.path.work_fields(particle_count), **RadauGrowth.work_fields()}

    @ti.func
    def begin(self, total_force: Template, first):
        """Take the deviation that the state has as the start of the first step."""
        self.path.begin(self.state, total_force, first)
        self.growth.keep(first // total_force.particle_count)

    @ti.func
    def follow(self, total_force: Template, first, begin, h):
        """Find the polynomial of the deviation in a step of the motion that was just accepted."""
        for i in range(first, first + total_force.particle_count):
            self.state.position[i], self.state.velocity[i] = self.state.start_position[i], self.state.start_velocity[i]
            self.state.tangent_position[i] = self.state.tangent_start_position[i]
            self.state.tangent_velocity[i] = self.state.tangent_start_velocity[i]
        self.evaluate(self.state, total_force, first, begin, "serial")
        for i in range(first, first + total_force.particle_count):
            self.state.tangent_start_acceleration[i] = self.found(self.state, total_force, first, i, begin)
        self.path.solve(self.state, total_force, self, first, begin, h, "serial")

    # The law of the polynomial: see RadauPolynomial.solve

    @ti.func
    def place(self, state: Template, total_force: Template, first, s, h):
        """Set the motion and the deviation to a node of the step."""
        self.motion.place(state, total_force, first, s, h, total_force.depends_on_velocity)
        self.path.place(state, total_force, first, s, h, total_force.depends_on_velocity)

    @ti.func
    def evaluate(self, state: Template, total_force: Template, first, time, shape: Template):
        """Sum the forces that do not depend on velocity; no evaluation of the motion is counted."""
        if ti.static(total_force.has_velocity_independent):
            now = parameter(self.dual_state, ti.cast(time, float))
            self.dual_force.accumulate(self.dual_state, first, now, shape)

    @ti.func
    def found(self, state: Template, total_force: Template, first, i, time):
        """The change of the acceleration of a particle, after `evaluate`."""
        total = zero_vector(self.dual_state)
        if ti.static(total_force.has_velocity_independent):
            total += self.dual_state.acceleration[i]
        if ti.static(total_force.depends_on_velocity):
            now = parameter(self.dual_state, ti.cast(time, float))
            total += self.dual_force.local_acceleration(self.dual_state, first, i, now, True)
        result = ti.Vector.zero(float, state.dimensions)
        for k in ti.static(range(state.dimensions)):
            result[k] = total[k].change
        return result

    # Between the nodes

    @ti.func
    def enter_next(self, total_force: Template, first, length, share):
        """Make the end of the step the start of the next step, longer by the factor `share`."""
        self.show(total_force, first, 1.0, length)
        r = first // total_force.particle_count
        squared = self.meter.squared(r)
        self.path.enter_next(self.state, total_force, first, ti.cast(length, float), share)
        if squared > LARGE:
            self._scale(total_force, first, r, -1)
        elif squared > 0.0 and squared < 1.0 / LARGE:
            self._scale(total_force, first, r, 1)
        self.growth.keep(r)

    @ti.func
    def show(self, total_force: Template, first, share, length):
        """Set the deviation and the sums of its growth to their values at the place `share` of the step.

        The growth is measured at the nodes of the part 0 … share, and at the end of this part.
        """
        r = first // total_force.particle_count
        h = ti.cast(length, float)
        for n in range(TERMS + 2):
            node = 0.0
            for c in ti.static(range(TERMS)):
                if n == c + 1:
                    node = NODES[c]
            if n == TERMS + 1:
                node = 1.0
            self.path.place(self.state, total_force, first, node * share, h, True)
            self.growth.take(r, n, self.meter.squared(r))
        self.growth.add(r, ti.cast(share, self.state.wide) * length)

    @ti.func
    def _scale(self, total_force: Template, first, r, sign):
        """Multiply the deviation and its polynomial by 2^±RANGE_BITS, which changes no digit."""
        factor = 2.0**-RANGE_BITS
        if sign > 0:
            factor = 2.0**RANGE_BITS
        for i in range(first, first + total_force.particle_count):
            for name in ti.static(self.path.memory):
                ti.static(getattr(self.state, name))[i] *= factor
        self.growth.shift(r, -sign * ti.static(RANGE_BITS))
