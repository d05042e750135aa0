"""Watchdog: warns when a run does not keep the energy that its forces conserve; `blow_up` handles runs that blow up."""

import logging
from typing import TYPE_CHECKING

from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.simulation.verdict import energy_finding

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

log = logging.getLogger(__name__)


class EnergyWatchdog:
    """Reads the table as it grows; warns of the first sample above the limit of the verdict, and keeps its time as `broken_at`.

    It must come after its table in the list of recorders. The limit holds while all forces present conserve energy.
    """

    def __init__(self, table: TableRecorder) -> None:
        """Watch a table."""
        self.table = table
        self.broken_at: float | None = None
        self._seen = 0

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Now, when the table has grown."""
        return 0 if len(self.table.rows) > self._seen else self.table.steps_until_due(simulation)

    def record(self, simulation: "Simulation") -> None:
        """Compare the new samples with the limit."""
        new = self.table.rows[self._seen :]
        self._seen = len(self.table.rows)
        for row in new:
            finding = energy_finding(row)
            if finding is None:
                continue
            simulation.judge.note(finding)
            if self.broken_at is None:
                self.broken_at = row["time"]
                log.warning(finding.message)

    def restart(self) -> None:
        """Watch the table from its start again; `broken_at` stays."""
        self._seen = 0
