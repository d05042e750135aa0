"""Ruth's third-order splitting."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting


@component
class Ruth3(Splitting):
    """Ruth's third-order method: three kicks and three drifts, symplectic, not time-reversible.

    Kicks 7/24, 3/4, −1/24, drifts 2/3, −2/3, 1, begun with a kick. Its energy error is larger than the error of three leapfrogs
    until steps are small. Source: Ruth, IEEE Trans. Nucl. Sci. NS-30 (1983) 2669.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 3
    drifts, kicks = (0.0, 2 / 3, -2 / 3, 1.0), (7 / 24, 3 / 4, -1 / 24)
