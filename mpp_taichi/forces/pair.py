"""A pair force whose potential is written in the scene."""

from mpp_taichi.component import Groups, Law, Numbers, component, param
from mpp_taichi.forces._formula import FormulaPair


@component
class Pair(FormulaPair):
    """Force between all pairs by a potential V(r) that the scene writes, F_i = V′(r) d/r with d = x_j − x_i and r = |d|.

    The formula may use r, the mass, charge and radius of both particles (m1, q1, R1 and m2, q2, R2), the constants of the
    scene and `parameters`. It is a function of r times the same function of either particle, such as `q1*q2/r`: then the two
    forces of a pair are opposite, and momentum is conserved. At a cutoff, which may be a formula of the numbers, the force ends
    with a jump, and V is shifted so that it is 0 beyond. With a softening ε > 0, r is √(|d|² + ε²). SymPy forms the derivatives
    that methods ask for; they are checked against differences of V before the run.
    """

    potential_: Law = param(
        names=("r", "m1", "m2", "q1", "q2", "R1", "R2"), unit="energy", help="V(r), such as 4*eps*((s/r)^12 - (s/r)^6)"
    )
    parameters: Numbers = param({}, slider=True, help="numbers by the names that the formula gives them")
    softening: float = param(0.0, minimum=0.0, unit="length", help="ε, the radius inside which the force is softened")
    cutoff: Law = param(
        None, optional=True, unit="length", help="distance beyond which there is no force; V is shifted to 0 there"
    )
    between: Groups = param(None, optional=True, help="two particles or groups; absent: all pairs interact")
    name: str = param(None, optional=True, help="a name for messages and for the paths of sliders, such as lennard_jones")
