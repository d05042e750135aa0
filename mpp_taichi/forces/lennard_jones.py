"""Lennard-Jones potential between all pairs."""

from mpp_taichi.component import Groups, Law, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class LennardJones(FormulaPair):
    """Lennard-Jones potential, V(r) = 4 ε ((σ/r)¹² − (σ/r)⁶): repulsion of closed shells and attraction of induced dipoles.

    The least energy, −ε, is at r = 2^(1/6) σ, where the curvature is 72 ε / (2^(1/3) σ²). The force acts between all particles,
    whatever their kind. Source: J. E. Lennard-Jones, Proc. Phys. Soc. 43 (1931) 461.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="energy", help="ε, the depth of the well")
    length: float = param(above=0.0, slider=True, unit="length", help="σ, the distance at which V is 0")
    softening: float = param(0.0, minimum=0.0, unit="length", help="radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "4*strength*((length/r)^12 - (length/r)^6)"
