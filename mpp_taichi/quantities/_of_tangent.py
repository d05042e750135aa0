"""Quantities that the growth of a small deviation gives."""

from abc import abstractmethod

import numpy as np

from mpp_taichi.quantities._base import ManySample, Quantity, RunSample
from mpp_taichi.state.tangent_growth import TangentGrowth


class OfTangent(Quantity):
    """A number of the growth L(t) = ln(|δ(t)|/|δ(0)|), where δ holds small deviations of all positions and velocities.

    Every step is taken together with its own derivative, so that δ is exact to round-off for the method and its steps; so is
    every flight and every collision of event-driven spheres. |δ|² is the sum of the squares of all components, in the units of
    the scene. δ(0) has a random direction, the same in every run.
    """

    takes_many = True
    needs_tangent = True

    @abstractmethod
    def of(self, growth: TangentGrowth) -> np.ndarray:
        """The number of each copy."""

    def measure(self, sample: RunSample) -> float:
        """The number."""
        return float(self.of(sample.tangent)[0])

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The number of each copy."""
        return self.of(many.tangent)
