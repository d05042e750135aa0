"""Buckingham potential between all pairs."""

from mpp_taichi.component import Groups, Law, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class Buckingham(FormulaPair):
    """Buckingham potential, V(r) = A e^(−B r) − C/r⁶: an exponential repulsion and the attraction of induced dipoles.

    At short distances the attraction wins, and V falls to −∞ behind a barrier: particles must start outside of it.
    Source: R. A. Buckingham, Proc. R. Soc. Lond. A 168 (1938) 264.
    """

    repulsion: float = param(minimum=0.0, slider=True, unit="energy", help="A")
    steepness: float = param(above=0.0, slider=True, unit="length⁻¹", help="B")
    attraction: float = param(minimum=0.0, slider=True, unit="energy length⁶", help="C")
    softening: float = param(0.0, minimum=0.0, unit="length", help="radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "repulsion*exp(-steepness*r) - attraction/r^6"
