"""How deep spheres were in each other."""

from mpp_taichi.component import component
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._gas import OfContacts


@component
class LargestOverlap(OfContacts):
    """Largest overlap of two spheres, or a sphere and a wall, that the contact solver saw, in units of the smaller radius."""

    after: float = 0.0

    def counted(self, report: ContactReport) -> float:
        """The largest so far."""
        return report.largest_overlap

    def result(self) -> float:
        """That of the whole run."""
        return self._total.totals[-1]
