"""Trajectory: positions and velocities along a run, streamed to disk as NumPy arrays or extended XYZ."""

import os
import shutil
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.atomic_file import fresh
from mpp_taichi.errors import OutputError
from mpp_taichi.recorders._extended_xyz import frame_lines
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.contact_setup import enclosure_of
from mpp_taichi.walls._base import Enclosure, Vector

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

FORMATS = (".npz", ".xyz", ".extxyz")
BYTES_PER_PARTICLE = 48  # of a frame: position and velocity in f64; a text file takes more


class TrajectoryRecorder:
    """Writes the particles every `every` steps, at the start and at the end; memory does not grow with the run.

    `.npz` holds time and step (frame_count,), position and velocity (frame_count, particle_count, 3) in f64, and mass, radius,
    charge, name as in a `Snapshot`; of a box that repeats, its period and origin (frame_count, 3). The frames are kept in raw
    files beside it until `close` packs them. `.xyz` and `.extxyz` are text, one block a frame. Where spheres merge, `.npz` has
    mass, radius and charge of every frame, 0 for a sphere that has merged, and merged_into as it is at the end; the text
    leaves merged spheres out. The file appears under its name only when it is whole. A context manager.
    """

    def __init__(self, path: str | Path) -> None:
        """Lock and open the file.

        Raises:
            OutputError: the suffix is none of `FORMATS`, or the file cannot be written.
        """
        self.path = Path(path)
        self.every = 1
        self.frame_count = 0
        self._last_step = -1
        suffix = self.path.suffix.lower()
        if suffix not in FORMATS:
            raise OutputError(f"{self.path}: the trajectory format {suffix!r} is none of {', '.join(FORMATS)}")
        self._lock = OutputLock(self.path)
        self._writer: _ArrayWriter | _TextWriter | None = None
        try:
            self._writer = _ArrayWriter(self.path) if suffix == ".npz" else _TextWriter(self.path)
        except OSError as error:
            self._lock.release()
            raise self._failure(error) from error

    def __enter__(self) -> "TrajectoryRecorder":
        """The recorder itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Keep the frames written so far, also after an exception."""
        self.close()

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Until the next frame."""
        return 0 if self._last_step < 0 else self._last_step + self.every - simulation.step_count

    def record(self, simulation: "Simulation") -> None:
        """Write a frame.

        Raises:
            OutputError: the disk is full.
        """
        assert self._writer is not None
        try:
            self._writer.write(simulation.snapshot(), enclosure_of(simulation.spec))
        except OSError as error:
            raise self._failure(error) from error
        self._last_step = simulation.step_count
        self.frame_count += 1

    def finish(self, simulation: "Simulation") -> None:
        """Write the last frame, unless there is a frame of this step."""
        if self._last_step != simulation.step_count:
            self.record(simulation)

    def restart(self) -> None:
        """The next frame is due at once; earlier frames stay."""
        self._last_step = -1

    def close(self) -> None:
        """Give the file its name, or remove it where it has no frame. Harmless when called twice."""
        if self._writer is None:
            return
        writer, self._writer = self._writer, None
        try:
            writer.close(keep=self.frame_count > 0)
        except OSError as error:
            raise self._failure(error) from error
        finally:
            self._lock.release()

    def _failure(self, error: OSError) -> OutputError:
        return OutputError(f"{self.path}: cannot write the trajectory: {error.strerror or error}")


class _ArrayWriter:
    """Raw frames in one file per array, packed into one `.npz` at the end."""

    ARRAYS = ("position", "velocity")
    CHANGING = ("mass", "radius", "charge")  # where spheres merge

    def __init__(self, path: Path) -> None:
        self.path = path
        self._parts: dict[str, Path] = {}
        self._streams: dict[str, IO[bytes]] = {}
        for name in self.ARRAYS:
            self._open(name)
        self._times: list[float] = []
        self._steps: list[int] = []
        self._boxes: list[tuple[Vector, Vector]] = []  # period and origin
        self._particles: Snapshot | None = None

    def _open(self, name: str) -> None:
        part = self.path.with_name(f"{self.path.name}.{name}.part")
        self._streams[name] = open(fresh(part), "w+b")
        self._parts[name] = part

    def write(self, snapshot: Snapshot, enclosure: Enclosure) -> None:
        if self._particles is None and snapshot.merged_into is not None:
            for name in self.CHANGING:
                self._open(name)
        for name, stream in self._streams.items():
            stream.write(np.ascontiguousarray(getattr(snapshot, name), dtype="<f8").tobytes())
        self._times.append(snapshot.time)
        self._steps.append(snapshot.step)
        self._boxes.append((enclosure.period, enclosure.origin))
        self._particles = snapshot

    def close(self, *, keep: bool) -> None:
        whole = self.path.with_name(self.path.name + ".part")
        try:
            if keep:
                with zipfile.ZipFile(fresh(whole), "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
                    self._pack(archive)
                os.replace(whole, self.path)
        finally:
            whole.unlink(missing_ok=True)
            for name, stream in self._streams.items():
                with suppress(OSError):  # the disk is full, and something was still to be written
                    stream.close()
                self._parts[name].unlink(missing_ok=True)

    def _pack(self, archive: zipfile.ZipFile) -> None:
        assert self._particles is not None
        small: dict[str, Any] = {"time": np.array(self._times), "step": np.array(self._steps)}
        fixed = (name for name in ("mass", "radius", "charge") if name not in self._streams)
        small |= {name: getattr(self._particles, name) for name in fixed}
        if self._particles.merged_into is not None:
            small["merged_into"] = self._particles.merged_into
        if any(any(period) for period, _ in self._boxes):
            small["period"], small["origin"] = (np.array(each, dtype=float) for each in zip(*self._boxes, strict=True))
        small["name"] = np.array(self._particles.name, dtype=np.str_)
        for name, values in small.items():
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, values, allow_pickle=False)
        frames = (len(self._times), self._particles.particle_count)
        for name, stream in self._streams.items():
            shape = frames if name in self.CHANGING else (*frames, 3)
            header = {"descr": "<f8", "fortran_order": False, "shape": shape}
            stream.seek(0)
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array_header_1_0(member, header)
                shutil.copyfileobj(stream, member, 1 << 20)


class _TextWriter:
    """Extended XYZ, one frame after the other. Where the disk is full, the frames that it holds whole are kept."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._part = path.with_name(path.name + ".part")
        self._stream = open(fresh(self._part), "wb")
        self._ends = [0]  # of the frames, in bytes

    def write(self, snapshot: Snapshot, enclosure: Enclosure) -> None:
        data = "".join(f"{line}\n" for line in frame_lines(snapshot, enclosure)).encode()
        self._ends.append(self._ends[-1] + len(data))
        self._stream.write(data)

    def close(self, *, keep: bool) -> None:
        try:
            self._stream.close()
        finally:
            held = os.path.getsize(self._part)
            whole = max(end for end in self._ends if end <= held)
            if keep and whole:
                os.truncate(self._part, whole)
                os.replace(self._part, self.path)
            self._part.unlink(missing_ok=True)
