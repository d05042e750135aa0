"""How many collisions there were."""

from mpp_taichi.component import component, param
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._gas import OfContacts


@component
class CollisionCount(OfContacts):
    """Number of collisions in the whole run."""

    between: str = param("all", choices=("all", "pairs", "walls"), help="of spheres with each other, with walls, or both")
    after: float = 0.0

    def counted(self, report: ContactReport) -> float:
        """What `between` asks for."""
        return (report.pair_count if self.between != "walls" else 0) + (report.wall_count if self.between != "pairs" else 0)

    def result(self) -> float:
        """The number at the last look."""
        return float(self._total.totals[-1])
