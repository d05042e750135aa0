"""The depth to which spheres have overlapped."""

from mpp_taichi.component import component
from mpp_taichi.quantities._base import Quantity, RunSample, Setting
from mpp_taichi.quantities._contacts import require_contacts


@component
class LargestOverlap(Quantity):
    """Largest overlap of two spheres, or of a sphere and a wall, that the contact solver has seen since the start of the run,
    in units of the smaller radius.
    """

    def begin(self, setting: Setting) -> None:
        """Check that the scene has contacts."""
        require_contacts(setting.spec)

    def label(self, setting: Setting) -> str:
        """Largest overlap."""
        return "largest overlap"

    def measure(self, sample: RunSample) -> float:
        """The largest so far."""
        return sample.contact_report.largest_overlap
