"""Trajectory: positions and velocities along a run, streamed to disk as NumPy arrays or extended XYZ."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.errors import OutputError
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.recorders._no_news import NoNews
from mpp_taichi.recorders._trajectory_arrays import ArrayWriter
from mpp_taichi.recorders._trajectory_text import TextWriter
from mpp_taichi.start.contact_setup import enclosure_of

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

FORMATS = (".npz", ".xyz", ".extxyz")
BYTES_PER_PARTICLE = 48  # of a frame: position and velocity in f64; a text file takes more


class TrajectoryRecorder(NoNews):
    """Writes the particles every `every` steps, at the start and at the end; memory does not grow with the run.

    `.npz` holds time and step (frame_count,), position and velocity (frame_count, particle_count, 3) in f64, and mass, radius,
    charge, name as in a `Snapshot`; of a box that repeats, its period and origin (frame_count, 3). The frames are kept in raw
    files beside it until `close` packs them. `.xyz` and `.extxyz` are text, one block a frame. Where spheres merge, or masses
    and charges are functions of the time, `.npz` has mass, radius and charge of every frame. Of spheres that merge it has
    merged_into as it is at the end, and 0 for the numbers of a sphere that has merged; the text leaves merged spheres out.
    The file appears under its name only when it is whole. A context manager.
    """

    def __init__(self, path: str | Path, *, waits: bool = False) -> None:
        """Lock and open the file; one that `waits` touches nothing that an earlier run has left until `begin_anew` or `go_on`.

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
        self._writer: ArrayWriter | TextWriter | None = ArrayWriter(self.path) if suffix == ".npz" else TextWriter(self.path)
        if not waits:
            try:
                self.begin_anew()
            except OutputError:
                self._lock.release()
                raise

    def begin_anew(self) -> None:
        """Open the file, in place of what an earlier run has left.

        Raises:
            OutputError: it cannot be written.
        """
        assert self._writer is not None
        try:
            self._writer.begin()
        except OSError as error:
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

    # For the archive of a run, see `RunOutput`.

    def at_record(self) -> dict[str, Any]:
        """How far the file is; so much of it is on the disk now.

        Raises:
            OutputError: the disk is full.
        """
        assert self._writer is not None
        try:
            return {"frame_count": self.frame_count, "last_step": self._last_step, **self._writer.at_record()}
        except OSError as error:
            raise self._failure(error) from error

    def go_on(self, simulation: "Simulation", saved: Mapping[str, Any], news: Iterator[list[Any]]) -> None:
        """Take over the frames of a record from the files that the broken run has left.

        Raises:
            StateError: they are not there, or have changed.
            OutputError: the disk is full.
        """
        assert self._writer is not None
        try:
            self._writer.go_on(saved, simulation.snapshot())
        except OSError as error:
            raise self._failure(error) from error
        self.frame_count, self._last_step = saved["frame_count"], saved["last_step"]

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
