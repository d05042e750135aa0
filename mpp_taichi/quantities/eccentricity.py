"""Eccentricity of the orbit of one body around another."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import RunSample
from mpp_taichi.quantities._orbit import OfOrbit


@component
class Eccentricity(OfOrbit):
    """Eccentricity e of the osculating orbit: 0 for a circle, from 1 on the bodies are not bound to each other.

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")
    noun = "eccentricity"

    def measure(self, sample: RunSample) -> float:
        """The eccentricity."""
        return self.orbit(sample).eccentricity
