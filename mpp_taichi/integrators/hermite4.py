"""Hermite's scheme of order 4."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._hermite import Hermite


@component
class Hermite4(Hermite):
    """Fourth order with the jerk of every force, predicted and corrected, with one evaluation per correction.

    Not symplectic; with two corrections or more nearly symmetric in time, so that the energy of a regular motion hardly
    drifts. Forces that depend on velocity, and forces without derivatives, are refused.
    Source: Makino & Aarseth, PASJ 44 (1992) 141; more corrections: Kokubo, Yoshinaga & Makino, MNRAS 297 (1998) 1067.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    corrections: int = param(2, minimum=1, maximum=10, help="evaluations and corrections of a step, n of P(EC)ⁿ")
    order = 4
    derivatives = 1
    needs_derivatives = True
    takes_velocity = False
