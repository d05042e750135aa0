"""TrajectoryFile: reads a `.npz` file of `TrajectoryRecorder`, one frame at a time."""

import contextlib
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from mpp_taichi.errors import OutputError, StateError
from mpp_taichi.generators._base import DEFAULT_COLOR
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.walls._base import Enclosure

MOST_BYTES = 1 << 31  # of a frame, or of an array that has no frames
# The exceptions of zipfile, zlib and NumPy on a damaged archive; NumPy reads an array's header with Python's tokenizer.
_DAMAGED: tuple[type[Exception], ...] = (
    *(OSError, EOFError, ValueError, KeyError, TypeError, RuntimeError, SyntaxError, tokenize.TokenError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
    *(tokenize.TokenError, SyntaxError, MemoryError, ArithmeticError),  # of the text in which NumPy describes an array
)
_VECTORS = ("position", "velocity")
_SCALARS = ("mass", "radius", "charge")
_MERGED = "merged_into"


def is_trajectory(path: Path) -> bool:
    """Whether the file is an archive with the arrays of a trajectory; the archive of a state has `meta` besides."""
    try:
        with zipfile.ZipFile(path) as archive:
            found = set(archive.namelist())
    except _DAMAGED:
        return False
    return "meta.npy" not in found and {"time.npy", "step.npy", "position.npy"} <= found


class TrajectoryFile:
    """The frames of a recorded run, one in memory at a time.

    time, step      of each frame, (frame_count,)
    period, origin  of the box that repeats, (frame_count, 3); zeros where there is none
    """

    def __init__(self, path: Path) -> None:
        """Read the arrays that have no frames.

        Raises:
            OutputError: the file cannot be read, or its arrays do not fit together.
        """
        self.path = path
        with self._archive() as archive:
            names = archive.namelist()
            self._shapes = {key: _shape(archive, key) for key in (*_VECTORS, *_SCALARS)}
            self.step = _whole(archive, "step", "iu")
            self.time = _whole(archive, "time", "f")
            frames, count = self.step.size, (self._shapes["position"] + (0, 0))[1]
            _check("step", self.step.shape, (frames,))
            _check("time", self.time.shape, (frames,))
            for key in _VECTORS:
                _check(key, self._shapes[key], (frames, count, 3))
            for key in _SCALARS:
                _check(key, self._shapes[key], (frames, count) if len(self._shapes[key]) == 2 else (count,))
            self._fixed = {key: _whole(archive, key, "f") for key in _SCALARS if len(self._shapes[key]) == 1}
            self._name = _whole(archive, "name", "U")
            _check("name", self._name.shape, (count,))
            self._merged_into = _whole(archive, _MERGED, "i") if f"{_MERGED}.npy" in names else None
            if self._merged_into is not None:
                _check(_MERGED, self._merged_into.shape, (count,))
            boxed = "period.npy" in names
            self.period = _whole(archive, "period", "f") if boxed else np.zeros((frames, 3))
            self.origin = _whole(archive, "origin", "f") if boxed else np.zeros((frames, 3))
            _check("period", self.period.shape, (frames, 3))
            _check("origin", self.origin.shape, (frames, 3))
            if not frames or not np.isfinite(self.time).all():
                raise ValueError("time must be finite numbers, one at least")

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return len(self.step)

    def frames(self) -> Iterator[tuple[Snapshot, Enclosure]]:
        """Each frame and the box that repeats; colours, held axes and springs are not recorded.

        Raises:
            OutputError: the file is damaged, or a number in it is not finite.
        """
        with self._archive() as archive, contextlib.ExitStack() as stack:
            moving = [key for key, shape in self._shapes.items() if key not in self._fixed]
            streams = {key: _opened(archive, key, stack) for key in moving}
            for frame in range(self.frame_count):
                arrays = {key: _next_frame(stream, self._shapes[key][1:], key) for key, stream in streams.items()}
                for key, array in arrays.items():
                    if not np.isfinite(array).all():
                        raise ValueError(f"{key} of frame {frame} is not finite")
                yield self._snapshot(frame, arrays | self._fixed), self._enclosure(frame)

    def _snapshot(self, frame: int, arrays: dict[str, Any]) -> Snapshot:
        count = len(arrays["mass"])
        merged = self._merged_into
        if merged is not None:  # recorded at the end of the run: a sphere that has not merged yet has its radius
            merged = np.where((merged >= 0) & (arrays["radius"] == 0.0), merged, -1)
        return Snapshot(
            **arrays,
            color=np.tile(DEFAULT_COLOR, (count, 1)),
            free=np.ones((count, 3), bool),
            name=tuple(self._name.tolist()),
            time=float(self.time[frame]),
            step=int(self.step[frame]),
            merged_into=merged,
            changing=() if "mass" in self._fixed or merged is not None else tuple(range(count)),
        )

    def _enclosure(self, frame: int) -> Enclosure:
        period, origin = (tuple(each[frame].tolist()) for each in (self.period, self.origin))
        return Enclosure((), period, origin)

    @contextlib.contextmanager
    def _archive(self) -> Iterator[zipfile.ZipFile]:
        try:
            with zipfile.ZipFile(self.path) as archive:
                yield archive
        except _DAMAGED as error:
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            raise OutputError(f"{self.path}: not a trajectory of this program: {reason}") from error


@contextlib.contextmanager
def opened_array(path: Path, key: str) -> Iterator[IO[bytes]]:
    """A stream of the numbers of one array of a file, behind its header.

    Raises:
        StateError: there is no such file, or it holds no such array.
    """
    with contextlib.ExitStack() as stack:
        try:
            stream = _opened(stack.enter_context(zipfile.ZipFile(path)), key, stack)
        except FileNotFoundError:
            raise StateError("its frames are not there") from None
        except _DAMAGED:
            raise StateError("its frames have changed") from None
        yield stream


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    return read(stream)


def _shape(archive: zipfile.ZipFile, key: str) -> tuple[int, ...]:
    """The shape of an array of float64; ValueError where bytes are missing, KeyError where there is no such array."""
    with archive.open(f"{key}.npy") as stream:
        shape, by_columns, kind = _header(stream)
        held = archive.getinfo(f"{key}.npy").file_size - stream.tell()
    wanted = 8
    for length in shape:  # exact, however large a damaged header makes it
        wanted *= int(length)
    if kind != np.dtype("<f8") or by_columns or wanted != held or wanted > MOST_BYTES * max(shape[:1], default=1):
        raise ValueError(f"{key} is {kind} of shape {shape} in {held:,} bytes")
    return shape


def _whole(archive: zipfile.ZipFile, key: str, kinds: str) -> np.ndarray:
    """The whole of an array of one of these kinds; pickles are refused."""
    if archive.getinfo(f"{key}.npy").file_size > MOST_BYTES:
        raise ValueError(f"{key} takes more than {MOST_BYTES:,} bytes")
    with archive.open(f"{key}.npy") as stream:
        shape, _, kind = _header(stream)
        wanted = kind.itemsize
        for length in shape:
            wanted *= int(length)
        if kind.kind not in kinds or wanted > MOST_BYTES:
            raise ValueError(f"{key} is {kind} of shape {shape}")
    with archive.open(f"{key}.npy") as stream:
        array: np.ndarray = np.lib.format.read_array(stream, allow_pickle=False)
    return array


def _opened(archive: zipfile.ZipFile, key: str, stack: contextlib.ExitStack) -> IO[bytes]:
    """A stream at the first frame of an array."""
    stream = stack.enter_context(archive.open(f"{key}.npy"))
    _header(stream)
    return stream


def _next_frame(stream: IO[bytes], shape: tuple[int, ...], key: str) -> np.ndarray:
    size = 8 * int(np.prod(shape))
    data = stream.read(size)
    if len(data) < size:
        raise EOFError(f"{key} ends too early")
    return np.frombuffer(data, "<f8").reshape(shape).astype(float)


def _check(key: str, shape: tuple[int, ...], wanted: tuple[int, ...]) -> None:
    if shape != wanted:
        raise ValueError(f"{key} has the shape {shape}, must be {wanted}")
