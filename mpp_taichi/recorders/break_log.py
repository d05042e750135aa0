"""Break log: every spring that broke in a run, with the time and the energy that it lost."""

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.errors import OutputError
from mpp_taichi.recorders.event_log import FORMATS

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

FIELDS = ("time", "i", "j", "energy")
FAR = 2**62  # steps


class BreakLog:
    """The springs that broke, in order of time.

    time     at which the spring broke, of the evaluation of the forces [time]
    i, j     the particles at its ends
    energy   potential energy that it lost, by yielding and by the break [energy]
    """

    def __init__(self) -> None:
        """Begin without a break."""
        self.restart()

    def restart(self) -> None:
        """Forget every break."""
        self._found: dict[str, np.ndarray] = {name: np.zeros(0) for name in FIELDS}

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Never before the end: the springs themselves keep the times at which they broke."""
        return FAR

    def record(self, simulation: "Simulation") -> None:
        """Read the springs; springs that broke at one time stand in the order of the scene."""
        springs, limits = simulation.snapshot().springs, simulation.phase.total_force.limits
        assert springs.broke_at is not None
        broken = np.flatnonzero(~springs.whole)
        order = broken[np.argsort(springs.broke_at[broken], kind="stable")]
        first, second = springs.between[order].T
        losses = limits.losses(simulation.state)[order]
        self._found = dict(zip(FIELDS, (springs.broke_at[order], first, second, losses), strict=True))

    def drain(self, simulation: "Simulation") -> None:
        """Read the springs, before an archive keeps this log."""
        self.record(simulation)

    def finish(self, simulation: "Simulation") -> None:
        """Read the springs at the end."""
        self.record(simulation)

    def __len__(self) -> int:
        """Count the springs that broke."""
        return len(self._found["time"])

    def columns(self) -> dict[str, np.ndarray]:
        """time, i, j and energy, (break_count,) each."""
        return self._found

    def save(self, path: Path) -> None:
        """Write all breaks as the suffix says, by way of a temporary file.

        Raises:
            OutputError: the suffix is none of `FORMATS`, or the file cannot be written.
        """
        if path.suffix.lower() not in FORMATS:
            raise OutputError(f"{path}: the event log's format {path.suffix!r} is none of {', '.join(FORMATS)}")
        found: dict[str, Any] = self.columns()
        with whole_file(path, "the event log") as temporary:
            if path.suffix.lower() == ".csv":
                with open(temporary, "w", encoding="utf-8", newline="") as stream:
                    writer = csv.writer(stream)
                    writer.writerow(found)
                    writer.writerows(zip(*(values.tolist() for values in found.values()), strict=True))
            else:
                with open(temporary, "wb") as raw:
                    np.savez(raw, **found)
