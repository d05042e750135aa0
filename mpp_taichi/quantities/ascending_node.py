"""Longitude of the ascending node of the orbit of one body around another."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import RunSample
from mpp_taichi.quantities._orbit import OfOrbit


@component
class AscendingNode(OfOrbit):
    """Longitude Ω of the ascending node of the osculating orbit, −π…π [radians]: where the body rises through the x–y plane.

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses. It is 0 where the orbit lies in the x–y plane.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")
    noun = "longitude of the node"

    def measure(self, sample: RunSample) -> float:
        """The longitude."""
        return self.orbit(sample).ascending_node
