"""Blanes and Moan's sixth-order method of eleven stages."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting

A = (0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075, 0.357208872795928)
B = (0.0414649985182624, 0.198128671918067, -0.0400061921041533, 0.0752539843015807, -0.0115113874206879)
A6 = 1.0 - 2.0 * sum(A)
B6 = 0.5 - sum(B)


@component
class Srkn11b(Splitting):
    """Kick–drift–…–kick of eleven forces per step, SRKN₁₁ᵇ: sixth order, symplectic, time-reversible.

    A Runge–Kutta–Nyström table, of order 4 only with forces that depend on velocity, which are refused.
    Source: Blanes & Moan, J. Comput. Appl. Math. 142 (2002) 313, table 3.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 6
    steps_about_center = True
    takes_velocity = False
    takes_rods = False
    drifts = (*A, A6, *reversed(A))
    kicks = (*B, B6, B6, *reversed(B))
