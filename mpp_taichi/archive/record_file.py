"""Record file: an append-only file of checksummed records.

The file begins with MAGIC. A record is a head, its payload and a tail:

    head   b"MREC", kind (1 byte), 3 empty bytes, number of the record (4 bytes), length of the payload (8 bytes), CRC-32 of
           the payload (4 bytes), CRC-32 of the head so far (4 bytes); all little-endian
    tail   b"MEND" and the number of the record again (4 bytes)

A record is written in two phases: head and payload are forced to the disk before the tail is written, so that a tail stands
only behind a whole payload. A reader takes records up to the first one that is not whole: what follows was torn off when the
machine or the program ended while it was being written. There is no index in the file; it is rebuilt by scanning the heads.
"""

import os
import struct
import zlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from mpp_taichi.errors import OutputError, StateError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

MAGIC = b"MPPRUN1\n"
HEAD = struct.Struct("<4sB3xIQI")
CHECK = struct.Struct("<I")
TAIL = struct.Struct("<4sI")
HEADER, STATE, END, OUTPUT = 1, 2, 3, 4  # kinds of records
MOST_BYTES = 1 << 28  # of a file without its outputs, beyond which states are thinned out


@dataclass(frozen=True)
class Record:
    """Where a record lies in its file."""

    kind: int
    number: int
    payload: int  # offset
    length: int

    @property
    def end(self) -> int:
        """Offset behind its tail."""
        return self.payload + self.length + TAIL.size


class RecordFile:
    """A file of records, open for reading and appending.

    records   all whole records, in the order in which they were written
    torn      bytes behind the last whole record, which were cut off when the file was opened
    """

    def __init__(self, path: Path, stream: IO[bytes], records: list[Record], torn: int) -> None:
        """Use a stream that stands behind the last record."""
        self.path, self._stream, self.records, self.torn = path, stream, records, torn

    @staticmethod
    def create(path: Path) -> "RecordFile":
        """A new file without records, in place of an old one, or of a symbolic link, which is not followed.

        Raises:
            OutputError: the file cannot be written, or another process writes it.
        """
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.is_symlink():
                path.unlink()
            flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
            descriptor = os.open(path, flags, 0o644)
            stream = os.fdopen(descriptor, "r+b")
            _reserve(stream, path)
            try:
                stream.truncate(0)
                stream.write(MAGIC)
                stream.flush()
            except OSError:  # an empty file would be taken for a damaged archive
                path.unlink(missing_ok=True)
                raise
        except OSError as error:
            raise OutputError(f"{path}: the archive cannot be written: {error.strerror or error}") from error
        return RecordFile(path, stream, [], 0)

    @staticmethod
    def open(path: Path, *, to_append: bool = True) -> "RecordFile":
        """An existing file, with its torn end cut off; not `to_append`: as it is, also while another process writes it.

        Raises:
            OutputError: the file cannot be read or written, or another process writes it.
            StateError: it is no file of records.
        """
        try:
            stream = open(path, "r+b" if to_append else "rb")
            if to_append:
                _reserve(stream, path)
                path.with_name(f"{path.name}.part").unlink(missing_ok=True)  # of a process that ended while it thinned out
            size = stream.seek(0, os.SEEK_END)
            stream.seek(0)
            if stream.read(len(MAGIC)) != MAGIC:
                stream.close()
                raise StateError(f"{path}: is no archive of a run")
            records = _scan(stream, size)
            end = records[-1].end if records else len(MAGIC)
            if end < size and to_append:
                stream.truncate(end)
            stream.seek(end)
        except OSError as error:
            raise OutputError(f"{path}: the archive cannot be read: {error.strerror or error}") from error
        return RecordFile(path, stream, records, size - end)

    def append(self, kind: int, payload: bytes) -> None:
        """Write a record, in two phases.

        Raises:
            OutputError: the disk is full, or cannot be written.
        """
        number, begin = len(self.records), self.records[-1].end if self.records else len(MAGIC)
        head = HEAD.pack(b"MREC", kind, number, len(payload), zlib.crc32(payload))
        try:
            self._write(head + CHECK.pack(zlib.crc32(head)), payload)
            self._write(TAIL.pack(b"MEND", number))
        except OSError as error:
            self._forget_from(begin)
            raise OutputError(f"{self.path}: the archive cannot be written: {error.strerror or error}") from error
        self.records.append(Record(kind, number, begin + HEAD.size + CHECK.size, len(payload)))

    def thin_out(self) -> None:
        """Where the file without outputs is too large, remove every second state, but not the last; the file is replaced.

        Raises:
            OutputError: the disk is full, or cannot be written; the file is as it was.
        """
        around = HEAD.size + CHECK.size + TAIL.size
        outputs = sum(record.length + around for record in self.records if record.kind == OUTPUT)
        if not self.records or self.records[-1].end - outputs <= MOST_BYTES:
            return
        states = [record for record in self.records if record.kind == STATE]
        self._remove(set(states[-2::-2]))

    def drop_outputs(self) -> None:
        """Remove the outputs, of which a run that has ended has the files; the file is replaced.

        Raises:
            OutputError: the disk is full, or cannot be written; the file is as it was.
        """
        if outputs := {record for record in self.records if record.kind == OUTPUT}:
            self._remove(outputs)

    def _remove(self, removed: set[Record]) -> None:
        thinned = RecordFile.create(self.path.with_name(f"{self.path.name}.part"))
        try:
            for record in self.records:
                if record not in removed:
                    thinned.append(record.kind, self.read(record))
            os.replace(thinned.path, self.path)
        except (OSError, OutputError) as error:
            thinned.close()
            thinned.path.unlink(missing_ok=True)
            raise OutputError(f"{self.path}: the archive cannot be thinned out: {error}") from error
        self._stream.close()
        self._stream, self.records = thinned._stream, thinned.records

    def cut_behind(self, record: Record) -> None:
        """Remove the records behind one of them.

        Raises:
            OutputError: the file cannot be written.
        """
        try:
            self._stream.seek(record.end)
            self._stream.truncate(record.end)
        except OSError as error:
            raise OutputError(f"{self.path}: the archive cannot be written: {error.strerror or error}") from error
        del self.records[self.records.index(record) + 1 :]

    def read(self, record: Record) -> bytes:
        """The payload of a record."""
        here = self._stream.tell()
        try:
            self._stream.seek(record.payload)
            return self._stream.read(record.length)
        finally:
            self._stream.seek(here)

    def last(self, kind: int) -> Record | None:
        """The last record of a kind."""
        return next((record for record in reversed(self.records) if record.kind == kind), None)

    def close(self) -> None:
        """Close the file; what a full disk has not taken of a record is dropped."""
        with suppress(OSError):  # every whole record is on the disk already
            self._stream.close()

    def _write(self, *parts: bytes) -> None:
        for data in parts:
            self._stream.write(data)
        self._stream.flush()
        os.fsync(self._stream.fileno())

    def _forget_from(self, offset: int) -> None:
        """Take back the part of a record that was written before an error."""
        try:
            self._stream.seek(offset)
            self._stream.truncate(offset)
        except OSError:
            return  # the torn record is cut off when the file is opened again


def _reserve(stream: IO[bytes], path: Path) -> None:
    """Let no other process write the file while it is open here; the system ends this with the process."""
    if fcntl is None:
        return
    try:
        fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        stream.close()
        raise OutputError(f"{path}: another process is writing this archive") from None


def _scan(stream: IO[bytes], size: int) -> list[Record]:
    """The whole records of a file, from the present place on."""
    records: list[Record] = []
    while (found := _whole_record(stream, len(records), size)) is not None:
        records.append(found)
    return records


def _whole_record(stream: IO[bytes], number: int, size: int) -> Record | None:
    head = stream.read(HEAD.size)
    check = stream.read(CHECK.size)
    if len(check) < CHECK.size or CHECK.unpack(check)[0] != zlib.crc32(head):
        return None
    mark, kind, its_number, length, check_of_payload = HEAD.unpack(head)
    payload = stream.tell()
    if mark != b"MREC" or its_number != number or payload + length + TAIL.size > size:
        return None
    if zlib.crc32(stream.read(length)) != check_of_payload or stream.read(TAIL.size) != TAIL.pack(b"MEND", number):
        return None
    return Record(kind, number, payload, length)
