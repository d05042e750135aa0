"""Leapfrog: drift, kick, drift."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting


@component
class Leapfrog(Splitting):
    """Drift–kick–drift leapfrog: second order, symplectic, time-reversible, one force per step.

    Stable on an oscillator for dt ω < 2. Source: Hairer, Lubich, Wanner, Acta Numerica 12 (2003) 399.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 2
    well_known = True
    moves_forward_alone = True
    takes_limits = True
    default_of_kind = True
    proposed_for = ("tree", "oscillation")
    drifts, kicks = (0.5, 0.5), (1.0,)
