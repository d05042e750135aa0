"""True anomaly of one body on its orbit around another."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import RunSample
from mpp_taichi.quantities._orbit import OfOrbit


@component
class TrueAnomaly(OfOrbit):
    """True anomaly f on the osculating orbit, the angle from the pericentre to the body, −π…π [radians].

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses. For a circle it is counted from the node, and for a circle in the x–y plane from the x axis.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")
    noun = "true anomaly"

    def measure(self, sample: RunSample) -> float:
        """The anomaly."""
        return self.orbit(sample).true_anomaly
