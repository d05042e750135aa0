"""Explicit midpoint rule."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._runge_kutta import MIDPOINT, RungeKutta


@component
class Midpoint(RungeKutta):
    """Explicit midpoint rule (Runge's second-order method): two forces per step, not symplectic, energy drifts.

    Source: Runge, Math. Ann. 46 (1895) 167.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 2
    a, b = MIDPOINT
