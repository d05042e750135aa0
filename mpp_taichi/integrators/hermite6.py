"""Hermite's scheme of order 6."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._hermite import Hermite


@component
class Hermite6(Hermite):
    """Sixth order with the jerk and snap of every force, predicted and corrected, with one evaluation per correction.

    Not symplectic; with two corrections or more nearly symmetric in time, so that the energy of a regular motion hardly
    drifts. Forces that depend on velocity, and forces without derivatives, are refused.
    Source: Nitadori & Makino, New Astronomy 13 (2008) 498, arXiv:0708.0738.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    corrections: int = param(2, minimum=1, maximum=10, help="evaluations and corrections of a step, n of P(EC)ⁿ")
    order = 6
    steps_about_center = True
    derivatives = 2
    needs_derivatives = True
    takes_velocity = False
