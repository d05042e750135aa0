"""The gas inside a closed skin, p = p₀ (V₀/V)^γ, and the work that it does; V is a volume or, in the plane, an area."""

import taichi as ti

from mpp_taichi.arithmetic.elementary_functions import elementary, power
from mpp_taichi.types import Template


@ti.func
def pressure_share(exponent: Template, start, now):
    """(V₀/V)^γ, in the precision of the run."""
    share = ti.cast(1.0, float)
    if ti.static(exponent == 1.0):
        share = start / now
    elif ti.static(exponent != 0.0):
        share = ti.cast(power(start / now, exponent), float)
    return share


@ti.func
def work_share(state: Template, exponent: Template, share):
    """∫ p dV / (p₀ V₀) from V₀ to `share` V₀, in the widest float."""
    work = share - 1.0
    if ti.static(exponent == 1.0):
        work = ti.cast(elementary("log", share), state.wide)
    elif ti.static(exponent != 0.0):
        work = (ti.cast(power(share, 1.0 - exponent), state.wide) - 1.0) / (1.0 - exponent)
    return work
