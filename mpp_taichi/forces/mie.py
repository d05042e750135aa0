"""Mie potential between all pairs."""

from mpp_taichi.component import Groups, Law, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class Mie(FormulaPair):
    """Mie potential, V(r) = C ε ((σ/r)ⁿ − (σ/r)ᵐ) with C = n/(n − m) (n/m)^(m/(n − m)), so that the least energy is −ε.

    With n = 12 and m = 6 it is the Lennard-Jones potential. Source: G. Mie, Ann. Phys. 316 (1903) 657.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="energy", help="ε, the depth of the well")
    length: float = param(above=0.0, slider=True, unit="length", help="σ, the distance at which V is 0")
    repulsion: float = param(12.0, above=0.0, unit="1", help="n, the exponent of the repulsion, larger than m")
    attraction: float = param(6.0, above=0.0, unit="1", help="m, the exponent of the attraction")
    softening: float = param(0.0, minimum=0.0, unit="length", help="radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = (
        "strength*repulsion/(repulsion - attraction)*(repulsion/attraction)^(attraction/(repulsion - attraction))"
        "*((length/r)^repulsion - (length/r)^attraction)"
    )
