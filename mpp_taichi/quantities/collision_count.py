"""The number of collisions."""

from mpp_taichi.component import component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting
from mpp_taichi.quantities._contacts import require_contacts


@component
class CollisionCount(Quantity):
    """Number of collisions since the start of the run."""

    between: str = param(
        "all", choices=("all", "pairs", "walls"), help="collisions between pairs of spheres, with walls, or both"
    )

    def begin(self, setting: Setting) -> None:
        """Check that the scene has contacts."""
        require_contacts(setting.spec)

    def label(self, setting: Setting) -> str:
        """`collisions of pairs`."""
        return {"all": "collisions", "pairs": "collisions of pairs", "walls": "collisions with walls"}[self.between]

    def measure(self, sample: RunSample) -> float:
        """The number, of the contacts that `between` names."""
        report = sample.contact_report
        pairs = report.pair_count if self.between != "walls" else 0
        return float(pairs + (report.wall_count if self.between != "pairs" else 0))
