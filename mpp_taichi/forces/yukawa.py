"""Screened Coulomb force between all charges."""

from mpp_taichi.component import Groups, Law, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class Yukawa(FormulaPair):
    """Yukawa potential, V(r) = k q₁ q₂ e^(−r/λ)/r: charges in a plasma or in a salt solution, which screens them beyond λ.

    For λ → ∞ it is Coulomb's. Equal signs repel. Source: Debye & Hückel, Phys. Z. 24 (1923) 185; H. Yukawa, Proc. Phys.-Math.
    Soc. Japan 17 (1935) 48.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="energy length charge⁻²", help="k")
    length: float = param(above=0.0, slider=True, unit="length", help="λ, the length of the screening")
    softening: float = param(0.0, minimum=0.0, unit="length", help="radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "strength*q1*q2*exp(-r/length)/r"
