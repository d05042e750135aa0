"""Yoshida's eighth-order composition of fifteen leapfrogs."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting
from mpp_taichi.integrators._splitting_table import of_leapfrogs


@component
class Yoshida8(Splitting):
    """Fifteen leapfrogs, Yoshida's solution D: eighth order, symplectic, time-reversible, fifteen forces per step.

    Of Yoshida's five solutions the solution with the smallest error terms; the terms of the best known solution, A, are two
    thousand times larger.
    Source: Yoshida, Phys. Lett. A 150 (1990) 262, table 2, whose fifteen digits leave 7e-15 in the equations of the order;
    here they are continued by Newton's iteration on these equations.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 8
    steps_about_center = True
    drifts, kicks = of_leapfrogs(
        *(0.91484424622979156675, 0.25369333656621135415, -1.44485223686060515769, -0.15824063536805017520),
        *(1.93813913762252598658, -1.96061023297531080761, 0.10279984939179644070),
    )
