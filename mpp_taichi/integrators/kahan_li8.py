"""Kahan and Li's eighth-order composition of seventeen leapfrogs."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting
from mpp_taichi.integrators._splitting_table import of_leapfrogs


@component
class KahanLi8(Splitting):
    """Seventeen leapfrogs: eighth order, symplectic, time-reversible, seventeen forces per step.

    Source: Kahan & Li, Math. Comput. 66 (1997) 1089, s17odr8a; Hairer, Lubich & Wanner (2006), eq. V.3.14.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 8
    steps_about_center = True
    proposed_for = ("friction",)
    drifts, kicks = of_leapfrogs(
        *(0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641, 0.15884190655515560090),
        *(-0.39590389413323757734, 0.18453964097831570709, 0.25837438768632204729, 0.29501172360931029887),
    )
