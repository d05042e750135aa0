"""Period of the orbit of one body around another, at one moment."""

import math

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import NoResultError, RunSample
from mpp_taichi.quantities._orbit import OfOrbit


@component
class OsculatingPeriod(OfOrbit):
    """Period 2π √(a³/μ) of the osculating orbit [time]; bodies that are not bound to each other have none.

    The osculating orbit is the Kepler orbit on which the two would go on if no other force acted, with G of newtonian_gravity
    and both masses. The diagnostic orbital_period measures a whole revolution instead.
    """

    of: Particles = param(help="a particle, or a group for its centre of mass")
    around: Particles = param(help="the particle that it is around, or a group for its centre of mass")
    noun = "osculating period"
    dimension = (0, 1, 0)

    def measure(self, sample: RunSample) -> float:
        """The period."""
        found = self.orbit(sample).period
        if not math.isfinite(found):
            raise NoResultError("the two are not bound to each other, so that the orbit has no period")
        return found
