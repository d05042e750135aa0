"""The number of collisions of a particle in a unit of time."""

from mpp_taichi.component import component, param
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._gas import OfContacts, require_no_merging
from mpp_taichi.quantities._base import Setting


@component
class CollisionRate(OfContacts):
    """Collisions of a particle with others in a unit of time, on average over all [time⁻¹]: 2 · pairs / (N t).

    Bounces off walls do not count. Enskog's theory says how many to expect: `kinetic_theory.collision_rate`, between walls
    `kinetic_theory.gas_in_box`.
    """

    after: float = param(0.0, minimum=0.0, unit="time", help="time from which collisions are counted")

    def prepare(self, setting: Setting) -> None:
        """Keep the number of particles."""
        require_no_merging(setting.spec)
        self._count = setting.start.particle_count

    def counted(self, report: ContactReport) -> float:
        """Two particles for every pair."""
        return 2.0 * report.pair_count / self._count

    def result(self) -> float:
        """Γ."""
        return self._total.rate()

    def standard_error(self) -> float:
        """The standard error of Γ, by ten blocks."""
        return self._total.standard_error()
