"""Morse potential between all pairs."""

from mpp_taichi.component import Groups, Law, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class Morse(FormulaPair):
    """Morse potential, V(r) = D ((1 − e^(−a (r − r₀)))² − 1): the bond of two atoms, which breaks if stretched too far.

    Small oscillations have the stiffness 2 D a². With the energy E < 0 of the relative motion of a pair of reduced mass μ, the
    angular frequency is a √(−2 E/μ). Source: P. M. Morse, Phys. Rev. 34 (1929) 57; the frequency: Landau & Lifshitz, Mechanics
    (1976), §12, problem 2.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="energy", help="D, the energy that breaks a bond")
    steepness: float = param(1.0, above=0.0, slider=True, unit="length⁻¹", help="a, the inverse of the width of the well")
    length: float = param(above=0.0, slider=True, unit="length", help="r₀, the length of a bond at rest")
    softening: float = param(0.0, minimum=0.0, unit="length", help="radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "strength*((1 - exp(-steepness*(r - length)))^2 - 1)"
