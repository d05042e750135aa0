"""Time, the default along x of a panel."""

from mpp_taichi.component import component
from mpp_taichi.quantities._base import Quantity, RunSample, Setting


@component
class Time(Quantity):
    """Simulated time t [time]."""

    dimension = (0, 1, 0)

    def label(self, setting: Setting) -> str:
        """Time."""
        return "time"

    def measure(self, sample: RunSample) -> float:
        """The time of the sample."""
        return sample.time
