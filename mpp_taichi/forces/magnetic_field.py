"""A uniform magnetic field."""

from mpp_taichi.component import AxialVector, Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class MagneticField(FormulaField):
    """Uniform magnetic field, a = (q/m) v × B.

    The force is across the velocity, so that it does no work. A charge circles with the angular frequency |q B/m| and the
    radius m v_⊥/|q B|; a force F across the field makes the circle drift with F × B/(q B²). Splitting methods solve the motion
    in the field inside each kick, to their own order. Source: Jackson, Classical Electrodynamics (1999), §12.2.
    """

    field: AxialVector = param(
        unit="mass time⁻¹ charge⁻¹", help="B, the flux density; in two dimensions only B_z acts in the plane"
    )
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formulas = (
        "q/m*(vy*field_z - vz*field_y)",
        "q/m*(vz*field_x - vx*field_z)",
        "q/m*(vx*field_y - vy*field_x)",
    )
