"""Symplectic Euler: kick, then drift."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting


@component
class SymplecticEuler(Splitting):
    """Symplectic (semi-implicit) Euler, v += dt a(x), then x += dt v: first order, energy bounded, not time-reversible.

    With velocities taken half a step earlier these are the equations of leapfrog. Its mirror image, drift then kick, undoes
    it. Stable on an oscillator for dt ω < 2. Source: de Vogelaere (1956).
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 1
    well_known = True
    moves_forward_alone = True
    takes_limits = True
    drifts_after_kick = True
    drifts, kicks = (0.0, 1.0), (1.0,)
