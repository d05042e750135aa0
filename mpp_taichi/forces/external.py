"""A force on each particle that is written in the scene."""

from mpp_taichi.component import Law, LawVector, Numbers, Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class External(FormulaField):
    """Force on each particle by a formula that the scene writes: a = −∇V/m of a potential V, or an acceleration.

    The formula may use the place x, y, z of the particle, its distance r from the origin, the time t, the mass m, the charge q,
    the radius R, the constants of the scene and `parameters`; an acceleration may also use the velocity vx, vy, vz and the
    speed v. The work of an acceleration, and of a potential that depends on time, enters the energy balance.
    """

    potential_: Law = param(
        None,
        optional=True,
        names=("x", "y", "z", "r", "t", "m", "q", "R"),
        unit="energy",
        help="V of one particle, such as m/2 * w^2 * (x^2 + y^2)",
    )
    acceleration: LawVector = param(
        None,
        optional=True,
        names=("x", "y", "z", "r", "t", "m", "q", "R", "vx", "vy", "vz", "v"),
        unit="length time⁻²",
        help="acceleration, a formula for each axis, in place of a potential",
    )
    parameters: Numbers = param({}, slider=True, help="numbers by the names that the formula gives them")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name for messages and for the paths of sliders, such as trap")
