"""The gravity of a star that loses mass."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class MassLoss(FormulaField):
    """Gravity of a star at the origin that loses mass, V = −G M exp(−k t) m/r.

    While the mass changes little in a period, the semi-major axis goes with 1/M, exp(k t), and the eccentricity stays.
    The star is no particle of the scene. Source: J. Jeans, Mon. Not. R. Astron. Soc. 85 (1924) 2.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    mass: float = param(above=0.0, unit="mass", help="M, the mass at the time 0")
    rate: float = param(slider=True, unit="time⁻¹", help="k, the share of its mass that the star loses a time")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "-strength*mass*m*exp(-rate*t)/r"
