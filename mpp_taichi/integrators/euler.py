"""Explicit Euler: the teaching contrast."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._runge_kutta import EULER, RungeKutta


@component
class Euler(RungeKutta):
    """Explicit Euler, x += dt v, v += dt a, both from the start of the step: first order, gains energy on every orbit.

    Source: Euler, Institutionum calculi integralis (1768).
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 1
    well_known = True
    a, b = EULER
