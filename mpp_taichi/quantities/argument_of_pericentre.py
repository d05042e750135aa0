"""Argument of the pericentre of the orbit of one body around another."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import RunSample
from mpp_taichi.quantities._orbit import OfOrbit


@component
class ArgumentOfPericentre(OfOrbit):
    """Argument ω of the pericentre of the osculating orbit, the angle from the node to it, −π…π [radians].

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses. It is 0 for a circle.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")
    noun = "argument of pericentre"

    def measure(self, sample: RunSample) -> float:
        """The argument."""
        return self.orbit(sample).argument_of_pericentre
