"""The potential of a halo of dark matter."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class NavarroFrenkWhite(FormulaField):
    """Halo of dark matter at the origin, V = −G M m ln(1 + r/a)/r with M = 4π ρ₀ a³.

    The density is ρ₀/((r/a) (1 + r/a)²), and circular orbits have v² = G M (ln(1 + x) − x/(1 + x))/r with x = r/a.
    Source: J. Navarro, C. Frenk & S. White, Astrophys. J. 490 (1997) 493.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    mass: float = param(above=0.0, slider=True, unit="mass", help="M = 4π ρ₀ a³")
    scale: float = param(above=0.0, slider=True, unit="length", help="a, the radius at which the slope of the density is −2")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "-strength*mass*m*log(1 + r/scale)/r"
