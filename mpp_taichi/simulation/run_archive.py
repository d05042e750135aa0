"""Run archive: the file from which a run that was cut off goes on, written while the run goes on.

The archive is a recorder. It writes a record from time to time by the wall clock, and so seldom that writing takes at most
`SHARE` of a processor; and when a phase begins. A run that ends before the first record leaves no file behind. A simulation is
`Any` here, as its class imports this module.
"""

import hashlib
import logging
import math
import time as clock
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.archive import object_state
from mpp_taichi.archive.record_file import END, HEADER, OUTPUT, STATE, RecordFile
from mpp_taichi.archive.values import pack, unpack
from mpp_taichi.errors import ArgumentError, OutputError, StateError
from mpp_taichi.simulation.moment import moment_of
from mpp_taichi.simulation.run_output import RunOutput
from mpp_taichi.version import __version__

log = logging.getLogger(__name__)

FORMAT = 2  # in format 1, the pictures of a film were compressed as a whole
EVERY = 3.0  # seconds of the wall clock between two records, so that a kill costs less than 5 s
SHARE = 0.01  # of the run, that writing records may take of a processor
PARTS = {  # of a header, beside its format and versions
    **{"scene": Mapping, "source": str, "backend": str, "device": str, "precision": str, "plan": str, "start": str},
    "options": Mapping,
}
SAME_RUN = ("scene", "backend", "precision", "plan", "start")  # parts of a header
MOST_PENDING = 1 << 26  # bytes of outputs that wait in memory, beyond which a record is written at once
MOST_OUTPUT = 1 << 31  # bytes of outputs in one archive, beyond which no more records are written
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
    outputs   the films and trajectories that the run writes, by name
    """

    def __init__(
        self,
        path: Path,
        header: Mapping[str, Any],
        objects: Mapping[str, Any],
        every: float | None = None,
        outputs: Mapping[str, RunOutput] | None = None,
    ) -> None:
        """Write to a path from now on, at most every so many seconds; the file is made at the first record."""
        self.path, self.header, self.objects, self.outputs = path, dict(header), dict(objects), dict(outputs or {})
        self.every = EVERY if every is None else every
        self._file: RecordFile | None = None
        self._output_bytes = 0
        self._stopped = self._failed = False
        self._due = clock.monotonic() + self.every
        self._began = clock.monotonic()
        self._wrote_step: int | None = None

    def go_on(self, found: "FoundRun") -> None:
        """Append to the file of the run that goes on."""
        self._file, self._wrote_step = found.file, None
        self._output_bytes = found.output_bytes

    def steps_until_due(self, simulation: Any) -> int:
        """0 when the wall clock says so, else a number that is never reached."""
        if clock.monotonic() >= self._due:
            return 0
        pending = 0 if self._stopped else sum(each.pending for each in self.outputs.values())
        return 0 if pending > MOST_PENDING else 2**31

    def record(self, simulation: Any) -> None:
        """Write the present moment, unless it is written; where this fails, warn once, and write no more."""
        began = clock.thread_time()  # a busy machine does not make records rarer
        if self._stopped:
            return
        if self._wrote_step != simulation.step_count:
            try:
                self._write(simulation)
            except OutputError as error:
                log.warning("%s; the run goes on without an archive", error)
                self._stop(failed=True)
                return
            self._wrote_step = simulation.step_count
            if self._output_bytes > MOST_OUTPUT:
                log.warning(
                    "%s: holds %d MiB of the film, and keeps no more; if the run is cut off later, it goes on from t = %.9g",
                    *(self.path, self._output_bytes >> 20, simulation.time),
                )
                self._stop()
                return
        self._due = clock.monotonic() + max(self.every, (clock.thread_time() - began) / SHARE)

    def _write(self, simulation: Any) -> None:
        if self._file is None:
            self._file = RecordFile.create(self.path)
            self._file.append(HEADER, pack(self.header))
        for each in self.objects.values():
            if hasattr(each, "drain"):
                each.drain(simulation)
        news = {name: each.news() for name, each in self.outputs.items()}
        if any(news.values()):
            payload = pack(news)
            self._file.append(OUTPUT, payload)
            self._output_bytes += len(payload)
        state = {"moment": moment_of(simulation), "samples": object_state.captured(self.objects)}
        state["outputs"] = {name: each.at_record() for name, each in self.outputs.items()}
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

    def _stop(self, *, failed: bool = False) -> None:
        """Write no more records; after a failure, close the file."""
        self._due, self._stopped = math.inf, True
        for each in self.outputs.values():
            each.stop()
        if failed:
            self._failed = self._file is not None
            self.close()

    def end(self, broken: Any = None) -> None:
        """Note that the run has come to its end, and is not to be gone on with; the states stay, for `replay`.

        `broken` is a simulation that blew up, and stands at its last good step: this moment is written, to rewind the run to.

        Raises:
            OutputError: the file cannot be written; it is removed where that is possible.
        """
        if self._failed:  # an old state is no use to a run that is complete
            self.path.unlink(missing_ok=True)
        if self._file is not None:
            try:
                if broken is not None:  # its samples belong to the blow-up
                    state = {"moment": moment_of(broken), "samples": {}, "outputs": {}}
                    self._file.append(STATE, pack({"time": broken.time, "step": broken.step_count, **state}))
                self._file.append(END, pack({} if broken is None else {"broke_at": broken.step_count + 1}))
                with suppress(OutputError):  # where there is no room for a smaller copy, the outputs stay as well
                    self._file.drop_outputs()
            except OutputError:
                self.path.unlink(missing_ok=True)
                raise
            finally:
                self.close()

    def close(self) -> None:
        """Close the file; the outputs gather no more news."""
        for each in self.outputs.values():
            each.stop()
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
        self.path, self.file, self._to_append = path, RecordFile.open(path, to_append=to_append), to_append
        self.torn = self.file.torn
        try:
            self.header = self._header()
        except BaseException:
            self.close()
            raise

    def _header(self) -> dict[str, Any]:
        """What the run was; of an older format it has the parts of the present one."""
        record = self.file.last(HEADER)
        if record is None:
            return {}
        found = unpack(self.file.read(record))
        written = found.get("format") if isinstance(found, dict) else None
        if not isinstance(written, int) or not isinstance(found.get("versions"), dict):
            raise StateError(f"{self.path}: its header is damaged")
        if written > FORMAT:
            version = found["versions"].get("mpp_taichi", "a later version")
            raise StateError(
                f"{self.path}: was written by mpp_taichi {version} in format {written}; this is {__version__}, which reads "
                f"formats up to {FORMAT}: use that version, or --fresh with the command of the run"
            )
        if wrong := [name for name, kind in PARTS.items() if not isinstance(found.get(name), kind)]:
            raise StateError(f"{self.path}: its header is damaged: it has no {wrong[0]}")
        return found

    @property
    def has_ended(self) -> bool:
        """Whether there is nothing to go on from: the run came to its end, or no state was written."""
        return self.file.last(STATE) is None or self.file.last(END) is not None

    @property
    def broke_at(self) -> int | None:
        """The step at which the run blew up; None where it did not."""
        end = self.file.last(END)
        found = None if end is None else unpack(self.file.read(end)).get("broke_at")
        return found if isinstance(found, int) else None

    def last_before(self, step: int | None) -> dict[str, Any] | None:
        """The last state before a step, or the last of all; None where there is none."""
        for number in reversed(range(len(self._states))):
            state = self.state(number)
            if step is None or state["step"] < step:
                return state
        return None

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

    @property
    def output_bytes(self) -> int:
        """Bytes of the outputs."""
        return sum(record.length for record in self.file.records if record.kind == OUTPUT)

    def news(self, name: str) -> Iterator[list[Any]]:
        """The news of one output, in the order in which they were kept, up to the last state.

        Where the run goes on, those behind it are removed.
        """
        last = self._states[-1]
        if self._to_append:
            self.file.cut_behind(last)
        for record in self.file.records[: last.number]:
            if record.kind == OUTPUT:
                yield unpack(self.file.read(record)).get(name, [])

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    @property
    def _states(self) -> list[Any]:
        return [record for record in self.file.records if record.kind == STATE]
