"""Longitude of the ascending node of the orbit of one body around another."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting
from mpp_taichi.quantities._orbit import orbit, orbit_label, require_orbit


@component
class AscendingNode(Quantity):
    """Longitude Ω of the ascending node of the osculating orbit, −π…π [radians]: where the body rises through the x–y plane.

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses. It is 0 where the orbit lies in
    the x–y plane.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")

    def begin(self, setting: Setting) -> None:
        """Check that there is gravity."""
        require_orbit(self.of, self.around, setting)

    def label(self, setting: Setting) -> str:
        """`longitude of the node of planet around sun`."""
        return orbit_label("longitude of the node", self.of, self.around, setting)

    def measure(self, sample: RunSample) -> float:
        """The longitude."""
        return orbit(sample, self.of, self.around).ascending_node
