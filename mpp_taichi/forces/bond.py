"""A force along springs whose potential is written in the scene."""

from mpp_taichi.component import Law, Numbers, Particles, component, param
from mpp_taichi.forces._formula_bond import FormulaBond


@component
class Bond(FormulaBond):
    """Force along the springs of a scene by a potential V(l) of their length, F_i = V′(l) d/l with d = x_j − x_i, l = |d|.

    The formula may use l, the rest length `rest` of the spring, the constants of the scene and `parameters`. The force acts
    beside the force of the springs themselves, D (l − rest): for the formula alone the springs get `stiffness: 0`. Their
    damping stays. A spring whose ends coincide has no direction and exerts no force.
    """

    potential_: Law = param(names=("l", "rest"), unit="energy", help="V(l), such as D*(1 - exp(-a*(l - l0)))^2")
    of: Particles = param(None, optional=True, help="the group between whose particles springs have the force; absent: all")
    parameters: Numbers = param({}, slider=True, help="numbers by the names that the formula gives them")
    name: str = param(None, optional=True, help="a name for messages, such as morse")
