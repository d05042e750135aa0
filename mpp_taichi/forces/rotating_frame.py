"""The forces in a frame that rotates."""

from mpp_taichi.component import AxialVector, Particles, component, param
from mpp_taichi.forces._formula import FormulaField


@component
class RotatingFrame(FormulaField):
    """Frame that rotates about the origin, a = 2 v × Ω + Ω² r − Ω (Ω·r): Coriolis and centrifugal acceleration.

    The centrifugal acceleration has the potential −(m/2) (Ω² r² − (Ω·r)²), and the Coriolis acceleration does no work, so that
    the energy of the moving particle, Jacobi's integral, is constant where all other forces are at rest in this frame.
    Source: Landau & Lifshitz, Mechanics (1976), §39.
    """

    rate: AxialVector = param(unit="time⁻¹", help="Ω, along the axis of the rotation")
    on: Particles = param(None, optional=True, help="the particle or group that feels the force; absent: every particle")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    formula = "-m/2*((rate_x^2 + rate_y^2 + rate_z^2)*(x^2 + y^2 + z^2) - (rate_x*x + rate_y*y + rate_z*z)^2)"
    formulas = (
        "2*(vy*rate_z - vz*rate_y)",
        "2*(vz*rate_x - vx*rate_z)",
        "2*(vx*rate_y - vy*rate_x)",
    )
