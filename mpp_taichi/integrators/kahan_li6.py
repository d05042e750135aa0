"""Kahan and Li's sixth-order composition of nine leapfrogs."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting
from mpp_taichi.integrators._splitting_table import of_leapfrogs


@component
class KahanLi6(Splitting):
    """Nine leapfrogs: sixth order, symplectic, time-reversible, nine forces per step; a ninth of yoshida6's error terms.

    Source: Kahan & Li, Math. Comput. 66 (1997) 1089, s9odr6a; Hairer, Lubich & Wanner (2006), eq. V.3.12.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 6
    steps_about_center = True
    proposed_for = ("friction",)
    drifts, kicks = of_leapfrogs(
        *(0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.08221359629355080023)
    )
