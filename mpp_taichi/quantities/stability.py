"""The largest multiplier of a periodic orbit."""

import numpy as np

from mpp_taichi.component import component
from mpp_taichi.quantities._base import Setting
from mpp_taichi.quantities._of_tangent import OfTangent
from mpp_taichi.state.tangent_growth import TangentGrowth


@component
class Stability(OfTangent):
    """Largest modulus of the multipliers: of the eigenvalues of the derivative of the motion from the start until now.

    Measure it after one period of a periodic orbit: at the end of a run of one period, or with `at:`. A deviation along the
    eigenvector of a multiplier μ is multiplied by μ in each period. The orbit is linearly stable where no |μ| exceeds 1. Each
    conserved quantity gives two multipliers 1, which are computed with errors of 10⁻⁴ and more, as they are multiple: a value
    below 1.01 is 1. Every free component of the positions and velocities is followed by a copy of the system, up to 600 copies.
    Source: Siegel & Moser, Lectures on Celestial Mechanics, Springer (1971), chapter 3.
    """

    dimension = (0, 0, 0)
    needs_derivative = True

    def label(self, setting: Setting) -> str:
        """Largest multiplier."""
        return "largest multiplier"

    def of(self, growth: TangentGrowth) -> np.ndarray:
        """The spectral radius of the derivative; NaN where a component of it is not finite."""
        derivative = growth.derivative
        assert derivative is not None
        found = np.full(len(derivative), np.nan)
        finite = np.isfinite(derivative).all(axis=(1, 2))
        found[finite] = np.abs(np.linalg.eigvals(derivative[finite])).max(axis=1, initial=0.0)
        return found
