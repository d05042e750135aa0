"""Logarithmic potential between all masses: gravity in the plane."""

from mpp_taichi.component import Groups, Law, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class Logarithmic(FormulaPair):
    """Logarithmic potential, V(r) = G m₁ m₂ log r: a force G m₁ m₂/r, as of gravity between parallel rods, or in a plane.

    Every circular orbit around a mass M has the speed √(G M), whatever its radius. V has no end: no body escapes.
    Source: Binney & Tremaine, Galactic Dynamics (2008), §2.3.2.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="energy mass⁻²", help="G")
    softening: float = param(0.0, minimum=0.0, unit="length", help="radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "strength*m1*m2*log(r)"
