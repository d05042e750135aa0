"""Parts of a trajectory: the temporary files into which frames are written, which a run that goes on finds again and cuts."""

import os
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from mpp_taichi.atomic_file import fresh
from mpp_taichi.errors import StateError

CHUNK = 1 << 20  # bytes that are read at once


class TrajectoryPart:
    """One growing file, with the checksum of all that was written to it.

    length   bytes written
    check    their CRC-32
    """

    def __init__(self, path: Path, stream: IO[bytes], length: int = 0, check: int = 0) -> None:
        """Use a stream that stands at its end."""
        self.path, self.stream, self.length, self.check = path, stream, length, check

    @staticmethod
    def begin(path: Path) -> "TrajectoryPart":
        """An empty file, in place of what was there; OSError where it cannot be made."""
        return TrajectoryPart(path, open(fresh(path), "w+b"))

    @staticmethod
    def of_leftover(path: Path, length: int, check: int) -> "TrajectoryPart | None":
        """The file that a killed run has left, cut to the bytes of a record; None where it does not hold them unchanged."""
        try:
            stream = os.fdopen(os.open(path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)), "r+b")
        except OSError:
            return None
        if checked_copy(stream, length, lambda data: None) != check:
            stream.close()
            return None
        stream.truncate(length)
        stream.seek(length)
        return TrajectoryPart(path, stream, length, check)

    @staticmethod
    def of_finished(path: Path, source: IO[bytes], length: int, check: int) -> "TrajectoryPart":
        """A new file with the first bytes of a stream of a finished file.

        Raises:
            StateError: the stream does not hold the bytes of the record.
            OSError: the disk is full.
        """
        part = TrajectoryPart.begin(path)
        try:
            if checked_copy(source, length, part.write) != check or part.length != length:
                raise StateError("its frames have changed, or are fewer than in the record")
        except BaseException:
            part.remove()
            raise
        return part

    def write(self, data: bytes) -> None:
        """Append bytes."""
        self.stream.write(data)
        self.length += len(data)
        self.check = zlib.crc32(data, self.check)

    def at_record(self) -> list[int]:
        """Length and checksum, after all bytes have reached the disk."""
        self.stream.flush()
        os.fsync(self.stream.fileno())
        return [self.length, self.check]

    def close(self) -> None:
        """Close the file, and leave it."""
        with suppress(OSError):  # the disk is full, and something was still to be written
            self.stream.close()

    def remove(self) -> None:
        """Close the file, and remove it."""
        self.close()
        self.path.unlink(missing_ok=True)


def checked_copy(source: IO[bytes], length: int, write: Callable[[bytes], Any]) -> int | None:
    """The CRC-32 of the next bytes of a stream, which are handed on to `write`; None where they are fewer or damaged."""
    check, left = 0, length
    while left > 0:
        try:
            data = source.read(min(CHUNK, left))
        except (EOFError, zipfile.BadZipFile, zlib.error):
            return None
        if not data:
            return None
        check, left = zlib.crc32(data, check), left - len(data)
        write(data)
    return check
