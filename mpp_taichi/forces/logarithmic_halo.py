"""The potential of a halo in which circular speeds are the same far out."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class LogarithmicHalo(FormulaField):
    """Logarithmic potential of a galaxy at the origin, V = (m/2) v₀² ln(R_c² + x² + y² + z²/q²).

    Far out, circular orbits in the plane z = 0 have the speed v₀ at every radius R: v² = v₀² R²/(R_c² + R²).
    Source: Binney & Tremaine, Galactic Dynamics (2008), equation 2.71.
    """

    speed: float = param(above=0.0, slider=True, unit="length time⁻¹", help="v₀, the speed of circular orbits far out")
    core: float = param(above=0.0, slider=True, unit="length", help="R_c, the radius of the core")
    flattening: float = param(1.0, above=0.0, slider=True, help="q, the axis ratio of the surfaces of equal potential")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "m/2*speed^2*log(core^2 + x^2 + y^2 + z^2/flattening^2)"
