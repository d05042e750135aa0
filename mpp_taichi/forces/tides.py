"""The tides that a moon raises on its planet, and their push on the moon."""

from mpp_taichi.component import AxialVector, Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class Tides(FormulaField):
    """Tide on a planet at the origin, a = −3 k G m R⁵/r⁸ (r + τ (2 r (r·v)/r² + r × Ω + v)), m the mass of the moon.

    The moon raises a bulge, which follows it with the delay τ and pulls at it. On a circle with the angular frequency n the
    distance changes by ȧ = 6 k τ G m R⁵ (Ω − n)/(n a⁷): a moon that is faster than the planet turns falls towards it, and a
    slower moon is driven away. The planet keeps its spin Ω, and its gravity is no part of the force.
    Source: F. Mignard, Moon and Planets 20 (1979) 301; P. Hut, Astron. Astrophys. 99 (1981) 126.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    radius: float = param(above=0.0, unit="length", help="R, the radius of the planet")
    love_number: float = param(minimum=0.0, slider=True, help="k, by which the planet yields; 0.3 for the earth")
    lag: float = param(minimum=0.0, slider=True, unit="time", help="τ, the delay of the bulge")
    spin: AxialVector = param(unit="time⁻¹", help="Ω, of the planet, along its axis")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formulas = (
        "-3*love_number*strength*m*radius^5/r^8*(x + lag*(2*x*(x*vx + y*vy + z*vz)/r^2 + y*spin_z - z*spin_y + vx))",
        "-3*love_number*strength*m*radius^5/r^8*(y + lag*(2*y*(x*vx + y*vy + z*vz)/r^2 + z*spin_x - x*spin_z + vy))",
        "-3*love_number*strength*m*radius^5/r^8*(z + lag*(2*z*(x*vx + y*vy + z*vz)/r^2 + x*spin_y - y*spin_x + vz))",
    )
