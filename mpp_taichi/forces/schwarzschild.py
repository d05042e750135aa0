"""General relativity near a star, to first order."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class Schwarzschild(FormulaField):
    """First post-Newtonian order about a mass at the origin, a = G M/(c² r³) ((4 G M/r − v²) r + 4 (r·v) v).

    The equations of motion of a light body in harmonic coordinates. A pericentre turns by 6π G M/(c² a (1 − e²)) a revolution.
    Periods are those of general relativity to this order as well; the periods in the potential `post_newtonian` are not.
    G M/(c² r) must be small. The Newtonian gravity of the star is no part of the force.
    Source: E. Poisson & C. Will, Gravity (2014), § 10.1; IERS Conventions (2010), § 10.3.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    mass: float = param(above=0.0, unit="mass", help="M, the mass of the star")
    speed_of_light: float = param(above=0.0, unit="length time⁻¹", help="c")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formulas = (
        "strength*mass/(speed_of_light^2*r^3)*((4*strength*mass/r - v^2)*x + 4*(x*vx + y*vy + z*vz)*vx)",
        "strength*mass/(speed_of_light^2*r^3)*((4*strength*mass/r - v^2)*y + 4*(x*vx + y*vy + z*vz)*vy)",
        "strength*mass/(speed_of_light^2*r^3)*((4*strength*mass/r - v^2)*z + 4*(x*vx + y*vy + z*vz)*vz)",
    )
