"""Blanes and Moan's fourth-order method of six stages."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting

A1, A2 = 0.245298957184271, 0.604872665711080
A3 = 0.5 - (A1 + A2)
B1, B2, B3 = 0.0829844064174052, 0.396309801498368, -0.0390563049223486
B4 = 1.0 - 2.0 * (B1 + B2 + B3)


@component
class Srkn6b(Splitting):
    """Kick–drift–…–kick of six forces per step, SRKN₆ᵇ: fourth order, symplectic, time-reversible.

    At equal numbers of forces its energy error on an orbit is a fortieth of PEFRL's, once steps are short. Its error terms were
    made small for forces that depend only on positions; the order is four with friction as well.
    Source: Blanes & Moan, J. Comput. Appl. Math. 142 (2002) 313, table 3.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 4
    proposed_for = ("friction",)
    drifts = (A1, A2, A3, A3, A2, A1)
    kicks = (B1, B2, B3, B4, B3, B2, B1)
