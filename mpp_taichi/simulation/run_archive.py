"""Run archive: the file from which a run that was cut off goes on, written while the run goes on.

The archive is a recorder. It writes a record from time to time by the wall clock, and so seldom that writing takes at most
`SHARE` of the run; and when a phase begins. A run that ends before the first record leaves no file behind. A simulation is
`Any` here, as its class imports this module.
"""

import hashlib
import logging
import math
import time as clock
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.archive import object_state
from mpp_taichi.archive.record_file import END, HEADER, STATE, RecordFile
from mpp_taichi.archive.values import pack, unpack
from mpp_taichi.errors import ArgumentError, OutputError, StateError
from mpp_taichi.simulation.moment import moment_of
from mpp_taichi.version import __version__

log = logging.getLogger(__name__)

FORMAT = 1
EVERY = 5.0  # seconds of the wall clock between two records
SHARE = 0.01  # of the run, that writing records may take
SAME_RUN = ("scene", "backend", "precision", "plan", "start")  # parts of a header
FIRST_PHASE = 1.0  # seconds before which the begin of a phase writes no record


def header_of(simulation: Any, options: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What a run is: the scene, the versions, the device, the digest of its start, and the options of the command line."""
    import taichi

    spec, device = simulation.scene, simulation.device
    return {
        "format": FORMAT,
        "scene": spec.resolved,
        "source": str(spec.source),
        "versions": {
            "mpp_taichi": __version__,
            "taichi": ".".join(map(str, taichi.__version__)),
            "numpy": np.__version__,
        },
        "backend": device.backend,
        "device": device.name,
        "precision": device.precision,
        "plan": simulation.plan,
        "start": start_digest(simulation),
        "options": dict(options or {}),
    }


def start_digest(simulation: Any) -> str:
    """A digest of the particles with which a run begins."""
    arrays = (getattr(simulation.start, name) for name in ("position", "velocity", "mass", "radius", "charge"))
    return hashlib.sha256(b"".join(np.ascontiguousarray(each).tobytes() for each in arrays)).hexdigest()


class RunArchive:
    """Writes the records of one run.

    header    what the run is: its scene, versions, device and options; written before the first state
    objects   the recorders whose samples belong to the run, by name; a recorder whose samples wait on the device has a
              method `drain`, which takes them from there
    """

    def __init__(self, path: Path, header: Mapping[str, Any], objects: Mapping[str, Any], every: float = EVERY) -> None:
        """Write to a path from now on, at most every so many seconds; the file is made at the first record."""
        self.path, self.header, self.objects, self.every = path, dict(header), dict(objects), every
        self._file: RecordFile | None = None
        self._due = clock.monotonic() + every
        self._began = clock.monotonic()
        self._wrote_step: int | None = None

    def go_on(self, found: "FoundRun") -> None:
        """Append to the file of the run that goes on."""
        self._file, self._wrote_step = found.file, None

    def steps_until_due(self, simulation: Any) -> int:
        """0 when the wall clock says so, else a number that is never reached."""
        return 0 if clock.monotonic() >= self._due else 2**31

    def record(self, simulation: Any) -> None:
        """Write the present moment, unless it is written; where this fails, warn once, and write no more."""
        began = clock.monotonic()
        if self._wrote_step != simulation.step_count:
            try:
                self._write(simulation)
            except OutputError as error:
                log.warning("%s; the run goes on without an archive", error)
                self.close()
                self._due = math.inf
                return
            self._wrote_step = simulation.step_count
        now = clock.monotonic()
        self._due = now + max(self.every, (now - began) / SHARE)

    def _write(self, simulation: Any) -> None:
        if self._file is None:
            self._file = RecordFile.create(self.path)
            self._file.append(HEADER, pack(self.header))
        for each in self.objects.values():
            if hasattr(each, "drain"):
                each.drain(simulation)
        state = {"moment": moment_of(simulation), "samples": object_state.captured(self.objects)}
        if simulation.scene.resolved != self.header["scene"]:  # parameters were set while the run was going on
            state["scene"] = simulation.scene.resolved
        self._file.append(STATE, pack({"time": simulation.time, "step": simulation.step_count, **state}))
        self._file.thin_out()

    def ask(self) -> None:
        """Write a record after the present launch."""
        self._due = min(self._due, 0.0) if math.isfinite(self._due) else self._due

    def phase_begins(self) -> None:
        """Write a record at the begin of a phase, of runs that take their time."""
        if self._file is not None or clock.monotonic() - self._began > FIRST_PHASE:
            self.ask()

    def end(self) -> None:
        """Note that the run has come to its end, and is not to be gone on with."""
        if self._file is not None:
            self._file.append(END, pack({}))
            self.close()

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None


def begin_archive(simulation: Any, path: Path, every: float) -> RunArchive:
    """An archive of a run in Python. Records are appended to an archive of the same run that ends no later than now.

    Raises:
        ArgumentError: `every` is no positive number of seconds.
    """
    if not 0.0 < every < math.inf:
        raise ArgumentError(f"every must be a positive number of seconds, got {every!r}")
    archive = RunArchive(path, header_of(simulation), {}, every)
    if path.is_file():
        found = FoundRun(path)
        times = found.times
        same = all(found.header.get(name) == archive.header[name] for name in SAME_RUN)
        if same and times and times[-1] <= simulation.time:
            archive.go_on(found)
        else:
            found.close()
    return archive


class FoundRun:
    """The archive of an earlier run.

    header    what the run was
    torn      bytes of a record that was being written when the run was cut off
    """

    def __init__(self, path: Path, *, to_append: bool = True) -> None:
        """Open the file, to append to it or only to read it.

        Raises:
            OutputError: the file cannot be read.
            StateError: it is no archive.
        """
        self.path, self.file = path, RecordFile.open(path, to_append=to_append)
        self.torn = self.file.torn
        header = self.file.last(HEADER)
        self.header: dict[str, Any] = {} if header is None else unpack(self.file.read(header))
        if self.header.get("format", FORMAT) > FORMAT:
            raise StateError(f"{path}: was written by a later version of this program, {self.header.get('versions')}")

    @property
    def has_ended(self) -> bool:
        """Whether there is nothing to go on from: the run came to its end, or no state was written."""
        return self.file.last(STATE) is None or self.file.last(END) is not None

    @property
    def times(self) -> list[float]:
        """The time of every state [time]."""
        return [float(self.state(number)["time"]) for number in range(len(self._states))]

    def state(self, number: int = -1) -> dict[str, Any]:
        """A state: its time, step, moment and samples; the last by default."""
        found: dict[str, Any] = unpack(self.file.read(self._states[number]))
        if not {"time", "step", "moment", "samples"} <= set(found):
            raise StateError(f"{self.path}: the record of a state lacks a part")
        return found

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    @property
    def _states(self) -> list[Any]:
        return [record for record in self.file.records if record.kind == STATE]
