"""Event log: every collision of a run, and the files they are written to."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.errors import OutputError

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

FORMATS = (".csv", ".npz")
FIELDS = ("time", "i", "j", "impulse")
HEADER = ("time", "i", "j", "surface", "impulse")


class EventLogRecorder:
    """Collects the collisions of the contact solver in batches, and keeps them in memory: 24 bytes each.

    time      of the collision [time]
    i, j      the two particles; j is −1 − w for a bounce off surface w
    impulse   size of the momentum that was exchanged [mass length / time]
    """

    def __init__(self, surfaces: Sequence[str] = (), every: int = 1) -> None:
        """`surfaces` are the names of the walls; the collisions are taken from the solver every `every` steps."""
        self.surfaces, self.every = tuple(surfaces), max(1, every)
        self.restart()

    def restart(self) -> None:
        """Forget every collision."""
        self._batches: list[tuple[np.ndarray, ...]] = []
        self._due_step = 0

    def append(self, time: Any, i: Any, j: Any, impulse: Any) -> None:
        """Add collisions, in order of time: four arrays of one length."""
        batch = (np.array(time, float), np.array(i, np.int32), np.array(j, np.int32), np.array(impulse, float))
        if len({part.shape for part in batch}) != 1 or batch[0].ndim != 1:
            raise ValueError(f"columns of different shapes: {[part.shape for part in batch]}")
        if len(batch[0]):
            self._batches.append(batch)

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Until the next batch."""
        return self._due_step - simulation.step_count

    def record(self, simulation: "Simulation") -> None:
        """Take the collisions that the contact solver has logged."""
        records = simulation.contacts.take_log() if simulation.contacts is not None else None
        if records is not None:
            self.append(*(records[name] for name in FIELDS))
        self._due_step = simulation.step_count + self.every

    def drain(self, simulation: "Simulation") -> None:
        """Take the collisions that wait on the device, before an archive keeps this log."""
        self.record(simulation)

    def finish(self, simulation: "Simulation") -> None:
        """Take the last batch."""
        self.record(simulation)

    def __len__(self) -> int:
        """Count the collisions."""
        return sum(len(batch[0]) for batch in self._batches)

    def columns(self) -> dict[str, np.ndarray]:
        """time, i, j and impulse, (collision_count,) each."""
        empty = (np.zeros(0), np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0))
        return {name: np.concatenate(parts) for name, parts in zip(FIELDS, zip(empty, *self._batches), strict=True)}

    def save(self, path: Path) -> None:
        """Write all collisions as the suffix says, by way of a temporary file; `.npz` also holds the names of the surfaces.

        Raises:
            OutputError: the suffix is none of `FORMATS`, or the file cannot be written.
        """
        if path.suffix.lower() not in FORMATS:
            raise OutputError(f"{path}: the event log's format {path.suffix!r} is none of {', '.join(FORMATS)}")
        with whole_file(path, "the event log") as temporary:
            if path.suffix.lower() == ".csv":
                with open(temporary, "w", encoding="utf-8", newline="") as stream:
                    self._write(csv.writer(stream))
            else:
                found: dict[str, Any] = {**self.columns(), "surface": np.array(self.surfaces, dtype=np.str_)}
                with open(temporary, "wb") as raw:
                    np.savez(raw, **found)

    def _write(self, writer: Any) -> None:
        """A line for each collision: j for two spheres, the surface's name for a bounce off it; the other cell stays empty."""
        writer.writerow(HEADER)
        for batch in self._batches:
            for time, i, j, impulse in zip(*(part.tolist() for part in batch), strict=True):
                partner = (j, "") if j >= 0 else ("", self._surface(-1 - j))
                writer.writerow([repr(time), i, *partner, repr(impulse)])

    def _surface(self, number: int) -> str:
        return self.surfaces[number] if number < len(self.surfaces) else f"surface {number}"
