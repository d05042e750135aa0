"""Blanes, Casas and Escorihuela's eighth-order method."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting

A = (
    *(0.160227696073839513690970240076, 0.306354507436867319879440957100, 0.308395508895171191756544975556),
    *(0.120362086566233408450063177659, -0.622888687549183872072186218718, 0.635560951632990078378672016548),
    *(-0.144226974795419229640437363913, -0.284867527074173816678992817545),
)
B = (
    *(0.0514196142537210073343152693459, 0.250497030318342871458417941091, 0.512412268300327350035492806653),
    *(-0.231597138650894401279645184364, 0.116091323536875759881216298975, -0.0098365173246965763985763034283),
    *(-0.108032771466281638634277563747, 0.249039864198023642002940910070),
)
A9 = 1.0 - 2.0 * sum(A)
B9 = 0.5 - sum(B)


@component
class Rkn8(Splitting):
    """Kick–drift–…–kick of seventeen forces per step: eighth order, symplectic, time-reversible.

    A Runge–Kutta–Nyström table, of order 4 only with forces that depend on velocity, which are refused. The outermost entries
    are kicks, b₁ = 0.0514…; taken for drifts, the same numbers make a method of fourth order.
    Source: Blanes, Casas & Escorihuela-Tomàs, Appl. Numer. Math. 182 (2022) 14, the method with 17 stages; arXiv:2202.01541.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 8
    steps_about_center = True
    takes_velocity = False
    takes_rods = False
    drifts = (*A, A9, *reversed(A))
    kicks = (*B, B9, B9, *reversed(B))
