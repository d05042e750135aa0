"""A trap whose force is linear in the place."""

from mpp_taichi.component import Particles, Vector, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class HarmonicTrap(FormulaField):
    """Harmonic trap about the origin, V = (m/2) (ω_x² x² + ω_y² y² + ω_z² z²).

    Each coordinate swings with its own angular frequency, whatever the amplitude. Frequencies in the ratio of whole numbers
    give closed Lissajous figures. For a saddle, where ω² is below 0, write `external:`.
    """

    frequencies: Vector = param(unit="time⁻¹", help="ω_x, ω_y, ω_z; 0 for an axis without a force")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "m/2*(frequencies_x^2*x^2 + frequencies_y^2*y^2 + frequencies_z^2*z^2)"
