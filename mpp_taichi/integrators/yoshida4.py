"""Yoshida's fourth-order composition of three leapfrogs."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting

W1 = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
W0 = 1.0 - 2.0 * W1


@component
class Yoshida4(Splitting):
    """Three leapfrogs of w₁, w₀, w₁ with w₁ = 1/(2 − 2^⅓), w₀ = 1 − 2 w₁: fourth order, symplectic, three forces per step.

    The middle leapfrog goes backwards in time. The table is the same as in Forest & Ruth, Physica D 43 (1990) 105.
    Source: Yoshida, Phys. Lett. A 150 (1990) 262.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 4
    proposed_for = ("tree",)
    drifts, kicks = (W1 / 2, (W0 + W1) / 2, (W0 + W1) / 2, W1 / 2), (W1, W0, W1)
