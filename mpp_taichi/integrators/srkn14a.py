"""Blanes and Moan's sixth-order method of fourteen stages."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting

A = (
    *(0.0378593198406116, 0.102635633102435, -0.0258678882665587, 0.314241403071447),
    *(-0.130144459517415, 0.106417700369543, -0.00879424312851058),
)
B = (0.09171915262446165, 0.183983170005006, -0.05653436583288827, 0.004914688774712854, 0.143761127168358, 0.328567693746804)
A8 = 1.0 - 2.0 * sum(A)
B7 = 0.5 - sum(B)


@component
class Srkn14a(Splitting):
    """Drift–kick–…–drift of fourteen forces per step, SRKN₁₄ᵃ: sixth order, symplectic, time-reversible.

    A Runge–Kutta–Nyström table, of order 4 only with forces that depend on velocity, which are refused.
    Source: Blanes & Moan, J. Comput. Appl. Math. 142 (2002) 313, table 3.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 6
    steps_about_center = True
    takes_velocity = False
    takes_rods = False
    drifts = (*A, A8, *reversed(A))
    kicks = (*B, B7, B7, *reversed(B))
