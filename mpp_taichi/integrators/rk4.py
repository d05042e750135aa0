"""The classical Runge–Kutta method."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._runge_kutta import CLASSICAL, RungeKutta


@component
class Rk4(RungeKutta):
    """Classical fourth-order Runge–Kutta: four forces per step, not symplectic, energy drifts at fifth order per step.

    On an oscillator it is stable for dt ω < 2√2. Source: Kutta, Z. Math. Phys. 46 (1901) 435.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 4
    well_known = True
    proposed_for = ("tree", "oscillation")
    a, b = CLASSICAL
