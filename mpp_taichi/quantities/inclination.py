"""Inclination of the orbit of one body around another."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import RunSample
from mpp_taichi.quantities._orbit import OfOrbit


@component
class Inclination(OfOrbit):
    """Inclination i of the osculating orbit to the x–y plane, 0…π [radians]; above π/2 the motion is retrograde.

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")
    noun = "inclination"

    def measure(self, sample: RunSample) -> float:
        """The inclination."""
        return self.orbit(sample).inclination
