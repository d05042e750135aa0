"""Yoshida's sixth-order composition of seven leapfrogs."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting
from mpp_taichi.integrators._splitting_table import of_leapfrogs


@component
class Yoshida6(Splitting):
    """Seven leapfrogs, Yoshida's solution A: sixth order, symplectic, time-reversible, seven forces per step.

    Sixth order needs at least seven leapfrogs; methods with more forces allow longer steps and have smaller errors: see
    kahan_li6, srkn11b, srkn14a.
    Source: Yoshida, Phys. Lett. A 150 (1990) 262, table 1; digits of Hairer, Lubich & Wanner, Geometric Numerical
    Integration, 2nd ed. (2006), eq. V.3.11.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 6
    steps_about_center = True
    drifts, kicks = of_leapfrogs(0.78451361047755726382, 0.23557321335935813368, -1.17767998417887100695)
