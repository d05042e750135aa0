"""Dormand and Prince's method of order eight with a step of its own choice."""

import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.integrators._embedded import Embedded
from mpp_taichi.integrators.dop853 import Dop853


@component
@ti.data_oriented
class AdaptiveDop853(Embedded):
    """Dop853 with its estimates of orders five and three as control of the step, and samples within a step of order seven.

    Twelve forces a step, three more for a step with a sample. Takes every force; energy drifts with the tolerance. Under
    gravity the tolerance ε is the error of an orbit, within a factor of 10: after n orbits the error at the mean distance is
    ε n (n + 1)/2 of the system's size. Under other forces it is the error of a step, in parts of the system's size and speeds.
    For smooth motion to six or more digits; to round-off, ias15.
    Source: Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993), §II.5, §II.6.
    """

    dt: float = param(None, optional=True, above=0.0, unit="time", help="time between samples; absent: run.duration / 1000")
    tolerance: float = param(1e-9, minimum=1e-15, maximum=0.1, help="error of an orbit under gravity, of a step otherwise")

    order = 8
    begins_anew = True
    promising_for = ("encounters",)
    pair = Dop853
    error_order = 8
    orbit_factor = 4.9
    leverage_factor = 0.9
