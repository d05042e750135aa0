"""The largest Lyapunov exponent."""

import numpy as np

from mpp_taichi.component import component
from mpp_taichi.quantities._base import Setting
from mpp_taichi.quantities._of_tangent import OfTangent
from mpp_taichi.state.tangent_growth import TangentGrowth


@component
class Lyapunov(OfTangent):
    """Largest Lyapunov exponent so far, L(t)/t [time⁻¹]; 0 at the start.

    For chaotic motion it tends to the rate λ at which neighbouring motions part, where 1/λ is the Lyapunov time; for regular
    motion it tends to 0 as (ln t)/t. Source: Benettin, Galgani, Giorgilli & Strelcyn, Meccanica 15 (1980) 9.
    """

    dimension = (0, -1, 0)

    def label(self, setting: Setting) -> str:
        """Largest Lyapunov exponent."""
        return "largest Lyapunov exponent"

    def of(self, growth: TangentGrowth) -> np.ndarray:
        """L/t."""
        return np.divide(growth.growth, growth.time, out=np.zeros_like(growth.growth), where=growth.time > 0.0)
