"""Velocity Verlet: kick, drift, kick."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting


@component
class VelocityVerlet(Splitting):
    """Kick–drift–kick leapfrog: second order, symplectic, time-reversible, one force per step (the last is kept).

    Stable on an oscillator for dt ω < 2. Source: Swope et al., J. Chem. Phys. 76 (1982) 637.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 2
    moves_forward_alone = True
    takes_limits = True
    drifts, kicks = (1.0,), (0.5, 0.5)
