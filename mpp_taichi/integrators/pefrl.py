"""Position-extended Forest–Ruth-like method."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting

XI = 0.1786178958448091
LAMBDA = -0.2123418310626054
CHI = -0.06626458266981849


@component
class Pefrl(Splitting):
    """Fourth-order splitting with four forces per step, optimised for a far smaller error than Yoshida's three.

    Source: Omelyan, Mryglod, Folk, Comput. Phys. Commun. 146 (2002) 188.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 4
    proposed_for = ("friction",)
    drifts = (XI, CHI, 1.0 - 2.0 * (CHI + XI), CHI, XI)
    kicks = ((1.0 - 2.0 * LAMBDA) / 2.0, LAMBDA, LAMBDA, (1.0 - 2.0 * LAMBDA) / 2.0)
