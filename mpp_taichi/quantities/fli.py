"""The fast Lyapunov indicator."""

import numpy as np

from mpp_taichi.component import component
from mpp_taichi.quantities._base import Setting
from mpp_taichi.quantities._of_tangent import OfTangent
from mpp_taichi.state.tangent_growth import TangentGrowth


@component
class Fli(OfTangent):
    """Fast Lyapunov indicator: the largest L(s) of all s ≤ t.

    It grows as λ t for chaotic motion and as ln t for regular motion. Source: Froeschlé, Lega & Gonczi, Celest. Mech. Dyn.
    Astron. 67 (1997) 41.
    """

    dimension = (0, 0, 0)

    def label(self, setting: Setting) -> str:
        """Fast Lyapunov indicator."""
        return "fast Lyapunov indicator"

    def of(self, growth: TangentGrowth) -> np.ndarray:
        """The largest growth so far."""
        return growth.largest
