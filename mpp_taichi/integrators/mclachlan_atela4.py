"""McLachlan and Atela's fourth-order method."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting


@component
class MclachlanAtela4(Splitting):
    """Fourth-order Runge–Kutta–Nyström splitting with four forces per step: symplectic, not time-reversible.

    A kick comes first. Of order 3 only where the kinetic energy is not quadratic or forces depend on velocity; such forces are
    refused. Source: McLachlan & Atela, Nonlinearity 5 (1992) 541.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 4
    takes_velocity = False
    takes_rods = False
    drifts = (0.0, 0.5153528374311229364, -0.085782019412973646, 0.4415830236164665242, 0.1288461583653841854)
    kicks = (0.1344961992774310892, -0.2248198030794208058, 0.7563200005156682911, 0.3340036032863214255)
