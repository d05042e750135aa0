"""The repulsive part of the Lennard-Jones potential."""

from mpp_taichi.component import Groups, Law, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class WeeksChandlerAndersen(FormulaPair):
    """Repulsion of soft spheres, V(r) = 4 ε ((σ/r)¹² − (σ/r)⁶) + ε up to r = 2^(1/6) σ, and 0 beyond.

    V and the force are continuous, and the slope of the force is not: methods that need it are refused.
    Source: Weeks, Chandler & Andersen, J. Chem. Phys. 54 (1971) 5237.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="energy", help="ε, the height of V at r = σ")
    length: float = param(above=0.0, slider=True, unit="length", help="σ, the diameter of a particle")
    softening: float = param(0.0, minimum=0.0, unit="length", help="radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "4*strength*((length/min(r, 2^(1/6)*length))^12 - (length/min(r, 2^(1/6)*length))^6) + strength"
