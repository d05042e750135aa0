"""The potential that turns the pericentre of an orbit as general relativity does."""

from mpp_taichi.component import Groups, Law, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class PostNewtonian(FormulaPair):
    """General relativity to the first order beyond Newton, as far as it turns a pericentre: V = −3 G² M m₁ m₂/(c² r²).

    Beside `newtonian_gravity` the pericentre of a light body about a mass M turns by 6π G M/(c² a (1 − e²)) in a period,
    42.98″ a century for Mercury. Other effects of the same order, such as on the period, are not those of general relativity.
    M is one number, so that the potential is right where one body is much heavier than all others. Source: A. Nobili &
    I. Roxburgh, in Relativity in Celestial Mechanics and Astrometry, IAU Symp. 114 (1986) 105.
    """

    strength: float = param(1.0, strength=True, slider=True, unit="length³ mass⁻¹ time⁻²", help="gravitational constant G")
    central_mass: float = param(above=0.0, unit="mass", help="M, the mass of the heavy body")
    speed_of_light: float = param(above=0.0, unit="length time⁻¹", help="c")
    softening: float = param(0.0, minimum=0.0, unit="length", help="radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "-3*strength^2*central_mass/speed_of_light^2*m1*m2/r^2"
