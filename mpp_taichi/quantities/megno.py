"""The mean MEGNO."""

import numpy as np

from mpp_taichi.component import component
from mpp_taichi.quantities._base import Setting
from mpp_taichi.quantities._of_tangent import OfTangent
from mpp_taichi.state.tangent_growth import TangentGrowth


@component
class Megno(OfTangent):
    """Mean exponential growth of nearby orbits ⟨Y⟩ = (1/t) ∫ Y ds with Y(s) = (2/s) ∫ (dL/dr) r dr; 0 at the start.

    It tends to 2 for quasi-periodic motion, to values below 2 near stable periodic orbits, and grows as λ t/2 for chaotic
    motion with the Lyapunov exponent λ. Source: Cincotta & Simó, Astron. Astrophys. Suppl. 147 (2000) 205; Cincotta,
    Giordano & Simó, Physica D 182 (2003) 151.
    """

    dimension = (0, 0, 0)

    def label(self, setting: Setting) -> str:
        """MEGNO."""
        return "MEGNO"

    def of(self, growth: TangentGrowth) -> np.ndarray:
        """The mean of Y over time."""
        return growth.megno
