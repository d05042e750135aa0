"""Bogacki and Shampine's pair with a step of its own choice."""

import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.integrators._embedded import Embedded
from mpp_taichi.integrators.bogacki_shampine import BogackiShampine


@component
@ti.data_oriented
class AdaptiveBogackiShampine(Embedded):
    """Steps of the third-order method, controlled by the second-order method inside it: the plainest control of a step.

    Three forces a step; samples within a step are on the cubic through both its ends. Takes every force; energy drifts with
    the tolerance. Under gravity the tolerance ε is the error of an orbit, within a factor of 10: after n orbits the error at
    the mean distance is ε n (n + 1)/2 of the system's size. Under other forces it is the error of a step, in parts of the
    system's size and speeds.
    Source: Bogacki & Shampine, Appl. Math. Lett. 2 (1989) 321.
    """

    dt: float = param(None, optional=True, above=0.0, unit="time", help="time between samples; absent: run.duration / 1000")
    tolerance: float = param(1e-6, minimum=1e-15, maximum=0.1, help="error of an orbit under gravity, of a step otherwise")

    order = 3
    begins_anew = True
    pair = BogackiShampine
    error_order = 3
    orbit_factor = 40.0
    leverage_factor = 0.5
