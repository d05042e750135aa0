"""Semi-major axis of the orbit of one body around another."""

import math

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import NoResultError, RunSample
from mpp_taichi.quantities._orbit import OfOrbit


@component
class SemiMajorAxis(OfOrbit):
    """Semi-major axis a of the osculating orbit [length]: below 0 for a hyperbola. A parabola has none.

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")
    noun = "semi-major axis"
    dimension = (1, 0, 0)

    def measure(self, sample: RunSample) -> float:
        """The axis."""
        found = self.orbit(sample).semi_major_axis
        if not math.isfinite(found):
            raise NoResultError("the orbit is a parabola, which has no semi-major axis")
        return found
