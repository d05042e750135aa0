"""Free flight from collision to collision."""

from mpp_taichi.component import component, param
from mpp_taichi.integrators._base import Integrator


@component
class EventDriven(Integrator):
    """Free flight, straight or under uniform gravity, from one collision to the next: exact, without a time step.

    It goes with `solver: event_driven` of the contacts, which moves the particles. A step is the time between two outputs; the
    motion does not depend on it.
    """

    dt: float = param(None, optional=True, above=0.0, unit="time", help="time between samples; absent: run.duration / 1000")
    symplectic = True
    time_reversible = True
    flies = True
    takes_sliders = False  # a flight is solved with constants made of the force

    def scratch_count(self, velocity_dependent: bool) -> int:
        """None."""
        return 0
