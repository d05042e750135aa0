"""The pressure and the drag of starlight on dust."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class RadiationPressure(FormulaField):
    """Light of a star at the origin, a = β (G M/r²) ((1 − v_r/c) e_r − v/c): pressure and Poynting–Robertson drag.

    β is the ratio of the pressure of light to gravity. Light from behind pushes less than light from the front, so that dust
    spirals into the star: a circular orbit shrinks from r to 0 in the time c r²/(4 G M β), where β is small. The gravity of the
    star is no part of it.
    Source: J. Burns, P. Lamy & S. Soter, Icarus 40 (1979) 1.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    mass: float = param(above=0.0, unit="mass", help="M, the mass of the star")
    ratio: float = param(minimum=0.0, slider=True, help="β, pressure of light over gravity")
    speed_of_light: float = param(above=0.0, unit="length time⁻¹", help="c")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formulas = (
        "ratio*strength*mass/r^2*((1 - (x*vx + y*vy + z*vz)/(r*speed_of_light))*x/r - vx/speed_of_light)",
        "ratio*strength*mass/r^2*((1 - (x*vx + y*vy + z*vz)/(r*speed_of_light))*y/r - vy/speed_of_light)",
        "ratio*strength*mass/r^2*((1 - (x*vx + y*vy + z*vz)/(r*speed_of_light))*z/r - vz/speed_of_light)",
    )
