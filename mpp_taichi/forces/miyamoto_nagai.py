"""The potential of a thick disc."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class MiyamotoNagai(FormulaField):
    """Disc of a galaxy in the plane z = 0, V = −G M m/√(x² + y² + (a + √(z² + b²))²).

    With a = 0 it is Plummer's sphere, with b = 0 Kuzmin's disc. Circular orbits in the plane have
    v² = G M R²/(R² + (a + b)²)^(3/2). Source: M. Miyamoto & R. Nagai, Publ. Astron. Soc. Japan 27 (1975) 533.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    mass: float = param(above=0.0, slider=True, unit="mass", help="M, the mass of the disc")
    scale: float = param(minimum=0.0, slider=True, unit="length", help="a, the scale of the disc along its plane")
    height: float = param(above=0.0, slider=True, unit="length", help="b, the scale of its thickness")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "-strength*mass*m/sqrt(x^2 + y^2 + (scale + sqrt(z^2 + height^2))^2)"
