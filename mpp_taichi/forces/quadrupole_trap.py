"""An electric quadrupole, which holds charges along one axis."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class QuadrupoleTrap(FormulaField):
    """Electric quadrupole about the origin, V = (q/2) U (z² − (x² + y²)/2), as in a Penning trap.

    A charge with q U > 0 swings along z with ω_z² = q U/m, and is pushed away from the axis with half of this force. With a
    `magnetic_field` along z, ω_c = q B/m, it stays near the axis if ω_c² > 2 ω_z²: its frequencies there are
    ω± = ω_c/2 ± √(ω_c²/4 − ω_z²/2). Source: L. S. Brown & G. Gabrielse, Rev. Mod. Phys. 58 (1986) 233.
    """

    strength: float = param(
        strength=True, slider=True, unit="mass time⁻² charge⁻¹", help="U, the curvature of the electric potential along z"
    )
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "q*strength*(z^2 - (x^2 + y^2)/2)/2"
