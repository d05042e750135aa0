"""Bogacki and Shampine's embedded pair of orders three and two."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._runge_kutta import RungeKutta


@component
class BogackiShampine(RungeKutta):
    """Third-order Runge–Kutta with a second-order method inside, a pair for a first course on step control; not symplectic.

    Three forces per step; the estimate of the error needs the first force of the next step as well. Here the step is fixed;
    adaptive_bogacki_shampine chooses it.
    Dense output: the cubic through positions and slopes of both ends.
    Source: Bogacki & Shampine, Appl. Math. Lett. 2 (1989) 321.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 3
    a = ((), (1 / 2,), (0.0, 3 / 4))
    b = (2 / 9, 1 / 3, 4 / 9)
    error_weights = ((-5 / 72, 1 / 12, 1 / 9, -1 / 8),)
    dense_weights = ((1.0, -4 / 3, 5 / 9), (0.0, 1.0, -2 / 3), (0.0, 4 / 3, -8 / 9), (0.0, -1.0, 1.0))
    dense_order = 3
