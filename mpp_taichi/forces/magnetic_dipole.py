"""The magnetic field of a dipole."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class MagneticDipole(FormulaField):
    """Magnetic dipole at the origin along z, a = (q/m) v × B with B = M (3 z r − r² e_z)/r⁵.

    A charge spirals along the lines of the field, is mirrored where the field is strong, and drifts around the dipole. Its
    speed is constant. The magnetic moment m v_⊥²/(2 B) is nearly constant while the circles are small.
    Source: Jackson, Classical Electrodynamics (1999), §5.6; C. Størmer, The Polar Aurora (1955).
    """

    strength: float = param(
        strength=True,
        slider=True,
        unit="length³ mass time⁻¹ charge⁻¹",
        help="M, the field at the distance 1 in the plane of the equator, with the opposite sign",
    )
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formulas = (
        "q/m*strength*(vy*(3*z^2 - r^2) - vz*3*y*z)/r^5",
        "q/m*strength*(vz*3*x*z - vx*(3*z^2 - r^2))/r^5",
        "q/m*strength*3*z*(vx*y - vy*x)/r^5",
    )
