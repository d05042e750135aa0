"""Period of the orbit of one body around another, at one moment."""

import math

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting
from mpp_taichi.quantities._orbit import orbit, orbit_label, require_orbit


@component
class OsculatingPeriod(Quantity):
    """Period 2π √(a³/μ) of the osculating orbit [time]; bodies that are not bound to each other have none.

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses. The diagnostic orbital_period
    measures a whole revolution instead.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")
    dimension = (0, 1, 0)

    def begin(self, setting: Setting) -> None:
        """Check that there is gravity."""
        require_orbit(self.of, self.around, setting)

    def label(self, setting: Setting) -> str:
        """`osculating period of planet around sun`."""
        return orbit_label("osculating period", self.of, self.around, setting)

    def measure(self, sample: RunSample) -> float:
        """The period."""
        found = orbit(sample, self.of, self.around).period
        if not math.isfinite(found):
            raise NoResultError("the two are not bound to each other, so that the orbit has no period")
        return found
