"""Radau growth: the integrals of the growth of a deviation over steps of ias15, by Gauss–Radau quadrature."""

import math

import taichi as ti

from mpp_taichi.integrators._radau import integrals
from mpp_taichi.integrators._radau_polynomial import NODES, TERMS
from mpp_taichi.state.lane_state import PREFIX
from mpp_taichi.state.tangent_meter import SUMS, TangentMeter
from mpp_taichi.types import Template

PLACES = (0.0, *NODES)
WITHIN = integrals(PLACES, PLACES)
"""Row k: the weights of the values at the nodes in the integral from 0 to node k."""
WHOLE = integrals(PLACES, (1.0,))[0]
KEPT, VALUES = PREFIX + "kept", PREFIX + "values"


@ti.data_oriented
class RadauGrowth:
    """The sums of a TangentMeter at the start of a step, and their growth from there, from L = ln|δ| at the 8 nodes.

    With I(t) = ∫ L dt the mean MEGNO is (2/t) ∫ (L − I/s) ds. A step of some tenth of a period is much too long for the
    trapezoidal rule; the nodes of the step integrate polynomials of degree 14.
    """

    memory = (KEPT,)

    def __init__(self, meter: TangentMeter) -> None:
        """Bind the meter."""
        self.meter, self.state = meter, meter.state

    @staticmethod
    def work_fields() -> dict[str, tuple[str, int]]:
        """The sums at the start of the step, and L at the nodes and at the end."""
        return {KEPT: ("wide", len(SUMS)), VALUES: ("wide", TERMS + 2)}

    @ti.func
    def keep(self, r):
        """Take the sums of now as those at the start of a step."""
        for c in ti.static(range(len(SUMS))):
            self.state.tangent_kept[ti.static(len(SUMS)) * r + c] = ti.static(self.meter.sums[SUMS[c]])[r]

    @ti.func
    def kept(self, r, name: Template):
        """A sum at the start of the step."""
        return self.state.tangent_kept[ti.static(len(SUMS)) * r + ti.static(SUMS.index(name))]

    @ti.func
    def shift(self, r, bits):
        """Note that the deviation was divided by 2^bits."""
        self.meter.sums["shift"][r] = self.meter.sums["shift"][r] + bits * ti.static(math.log(2.0))

    @ti.func
    def take(self, r, n, squared):
        """Keep L at node n, where δ² is `squared`; n = 8 is the end."""
        self.state.tangent_values[ti.static(TERMS + 2) * r + n] = self.meter.sums["shift"][r] + 0.5 * self.meter.logarithm(
            squared
        )

    @ti.func
    def add(self, r, span):
        """Set the sums to those at the start of the step and the growth in the time `span` from there."""
        values = ti.static(TERMS + 2) * r
        elapsed, integral = self.kept(r, "elapsed"), self.kept(r, "growth_integral")
        megno, largest = self.kept(r, "megno_integral"), self.kept(r, "largest_growth")
        gained = ti.cast(0.0, self.state.wide)
        for k in ti.static(range(TERMS + 1)):
            until = integral
            for j in ti.static(range(TERMS + 1)):
                until += span * (WITHIN[k][j] * self.state.tangent_values[values + j])
            time = elapsed + span * PLACES[k]
            value = self.state.tangent_values[values + k]
            largest = ti.max(largest, value)
            gained += span * WHOLE[k] * value
            if time > 0.0:
                megno += 2.0 * span * WHOLE[k] * (value - until / time)
        self.meter.sums["elapsed"][r] = elapsed + span
        self.meter.sums["growth"][r] = self.state.tangent_values[values + ti.static(TERMS + 1)]
        self.meter.sums["growth_integral"][r] = integral + gained
        self.meter.sums["megno_integral"][r] = megno
        self.meter.sums["largest_growth"][r] = ti.max(largest, self.meter.sums["growth"][r])
