"""Argument of the pericentre of the orbit of one body around another."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting
from mpp_taichi.quantities._orbit import orbit, orbit_label, require_orbit


@component
class ArgumentOfPericentre(Quantity):
    """Argument ω of the pericentre of the osculating orbit, the angle from the node to it, −π…π [radians].

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses. It is 0 for a circle.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")

    def begin(self, setting: Setting) -> None:
        """Check that there is gravity."""
        require_orbit(self.of, self.around, setting)

    def label(self, setting: Setting) -> str:
        """`argument of pericentre of planet around sun`."""
        return orbit_label("argument of pericentre", self.of, self.around, setting)

    def measure(self, sample: RunSample) -> float:
        """The argument."""
        return orbit(sample, self.of, self.around).argument_of_pericentre
