"""The field of a flattened planet beyond the field of its mass."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class Oblateness(FormulaField):
    """Flattening of a planet that stands at the origin with its axis along z, by the moments J₂ and J₄.

    V = (G M m/r) (J₂ (a/r)² P₂(s) + J₄ (a/r)⁴ P₄(s)) with s = z/r, P₂ = (3 s² − 1)/2 and P₄ = (35 s⁴ − 30 s² + 3)/8, beside the
    gravity of the planet, which is no part of it. The node of a satellite moves by
    −(3/2) n J₂ (a/p)² cos i a time, with its mean motion n, p = a_s (1 − e²) and inclination i, to first order in J₂.
    Source: Murray & Dermott, Solar System Dynamics (1999), §6.11.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    mass: float = param(above=0.0, unit="mass", help="M, the mass of the planet")
    planet_radius: float = param(above=0.0, unit="length", help="a, the radius of its equator")
    j2: float = param(slider=True, help="J₂, above 0 for a planet that is flattened")
    j4: float = param(0.0, slider=True, help="J₄")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = (
        "strength*mass*m/r*(j2*(planet_radius/r)^2*(3*(z/r)^2 - 1)/2 + j4*(planet_radius/r)^4*(35*(z/r)^4 - 30*(z/r)^2 + 3)/8)"
    )
