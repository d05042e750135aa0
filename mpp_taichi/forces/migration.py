"""Migration and the damping of eccentricities by a disc of gas."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class Migration(FormulaField):
    """Planets that migrate in a disc about a star at the origin, a = −(k_a/2) v − 2 k_e (v·r) r/r².

    The semi-major axis of a circular orbit goes with exp(−k_a t), and a small eccentricity with exp(−k_e t). A rate k_a below 0
    leads outwards.
    Source: J. Papaloizou & J. Larwood, Mon. Not. R. Astron. Soc. 315 (2000) 823.
    """

    rate: float = param(slider=True, unit="time⁻¹", help="k_a, at which the semi-major axis falls")
    circularization: float = param(0.0, slider=True, unit="time⁻¹", help="k_e, at which the eccentricity falls")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formulas = (
        "-rate/2*vx - 2*circularization*(x*vx + y*vy + z*vz)*x/r^2",
        "-rate/2*vy - 2*circularization*(x*vx + y*vy + z*vz)*y/r^2",
        "-rate/2*vz - 2*circularization*(x*vx + y*vy + z*vz)*z/r^2",
    )
