"""Van der Waals attraction between all pairs."""

from mpp_taichi.component import Groups, Law, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class VanDerWaals(FormulaPair):
    """Van der Waals attraction, V(r) = −C/r⁶: two induced dipoles far apart, without the repulsion at short distances.

    Particles that meet need contacts, or a softening. Source: F. London, Z. Phys. 63 (1930) 245.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="energy length⁶", help="C")
    softening: float = param(0.0, minimum=0.0, unit="length", help="radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "-strength/r^6"
