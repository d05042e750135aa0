"""Journal: what a study has finished, so that the same command after a kill takes it from there.

A study (`check`, `compare`, `accuracy`) consists of pieces of work that it does one after the other. It puts the result of each
into the journal under a key that names the piece, and asks the journal before it begins a piece. Results are gathered in memory
and written by a thread of their own, the first after `AFTER` seconds, so that a short study leaves no file, and then so seldom
that writing takes at most `SHARE` of the time of a processor. The file is removed when the study has ended well.
"""

import logging
import math
import threading
import time as clock
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from mpp_taichi.archive.record_file import HEADER, STATE, RecordFile
from mpp_taichi.archive.values import pack, unpack
from mpp_taichi.errors import OutputError, StateError

log = logging.getLogger(__name__)

AFTER = 3.0  # seconds after which a study leaves a journal, so that a kill costs less than 5 s
EVERY = 0.5  # seconds between two records
SHARE = 0.01  # of the time of a processor, that writing may take
ANEW = "it begins anew"


class Journal:
    """The memory of one study: key → result; a context manager that writes what is left and closes the file.

    taken   keys whose results were taken from an earlier, unfinished study
    torn    bytes of a record that was being written when that study was cut off
    """

    def __init__(
        self,
        path: Path | None,
        known: Mapping[str, Any],
        *,
        fresh: bool = False,
        tell: Callable[[str], None] = lambda _: None,
        after: float | None = None,
    ) -> None:
        """Read the journal of an unfinished study of the same kind, unless a `fresh` start is asked for.

        path    of the file; None: nothing is read and nothing is kept
        known   what all results depend on (versions, machine, options), as plain values; a journal that differs in it is not
                used, and `tell` is given one line that says why

        Raises:
            OutputError: another process writes the file, or it cannot be read.
        """
        self.path, self.known = path, dict(known)
        self.taken: set[str] = set()
        self.torn = 0
        self._found: dict[str, Any] = {}
        self._waiting: dict[str, Any] = {}
        self._file: RecordFile | None = None
        self._may_write, self._wakes = threading.Lock(), threading.Event()
        self._writer: threading.Thread | None = None
        self._stopped = path is None
        self._due = clock.monotonic() + (AFTER if after is None else after)
        if path is not None and path.is_file():
            self._open(path, fresh, tell)

    @property
    def holds(self) -> int:
        """Number of results of the unfinished study."""
        return len(self._found)

    def get(self, key: str) -> Any:
        """The result that an unfinished study had for a key; None where there is none. What was put here does not count."""
        if key not in self._found:
            return None
        self.taken.add(key)
        return self._found[key]

    def starting(self, prefix: str) -> dict[str, Any]:
        """All results of the unfinished study whose keys start so, by key."""
        return {key: self.get(key) for key in self._found if key.startswith(prefix)}

    def put(self, key: str, result: Any | Callable[[], Any]) -> None:
        """Keep the result of a piece of work; a function is called when the result is written, in another thread."""
        if self._stopped:
            return
        with self._may_write:
            self._waiting[key] = result
        if self._writer is None:
            writer = threading.Thread(target=self._write_when_due, name="journal", daemon=True)
            try:
                writer.start()
            except RuntimeError:
                log.warning("%s: the system starts no thread for it; the study goes on without a journal", self.path)
                self._stopped = True
                return
            self._writer = writer

    def flush(self) -> None:
        """Write all results that wait, whether it is time for it or not; where that fails, warn once and write no more."""
        with self._may_write:
            if self._stopped or not self._waiting or self.path is None:
                return
            began = clock.thread_time()
            try:
                if self._file is None:
                    self._file = RecordFile.create(self.path)
                    self._file.append(HEADER, pack(self.known))
                results = {key: value() if callable(value) else value for key, value in self._waiting.items()}
                self._file.append(STATE, pack(results))
                self._waiting.clear()
            except OutputError as error:
                log.warning("%s; the study goes on without a journal", error)
                self._stopped = True
            # Waiting for the disk costs the study nothing: it goes on in the meantime.
            self._due = clock.monotonic() + max(EVERY, (clock.thread_time() - began) / SHARE)

    def end(self) -> None:
        """The study has ended well: nothing is to be gone on with, and the file is removed."""
        self._stop()
        if self.path is not None and self._file is not None:
            self.path.unlink(missing_ok=True)
        self._close()

    def close(self) -> None:
        """Write what is left, where the study took long enough to leave a journal, and close the file."""
        if self._file is not None or clock.monotonic() >= self._due:
            self.flush()
        self._stop()
        self._close()

    def __enter__(self) -> "Journal":
        """Return this journal."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Close the file; it stays, unless `end` was called."""
        self.close()

    # Internals

    def _open(self, path: Path, fresh: bool, tell: Callable[[str], None]) -> None:
        """Read the results, or remove a file that is not to be used."""
        file = None
        try:
            file = RecordFile.open(path)
            if not fresh:
                self._read(file)
        except StateError as error:
            tell(f"{error}: {ANEW}")
            self._found.clear()
        if file is not None and self._found:
            self._file, self.torn = file, file.torn
            self._due = clock.monotonic() + EVERY
            return
        path.unlink(missing_ok=True)
        if file is not None:
            file.close()

    def _read(self, file: RecordFile) -> None:
        header = file.last(HEADER)
        there = {} if header is None else unpack(file.read(header))
        if header is not None and (
            changed := [key for key in {**there, **self.known} if there.get(key) != self.known.get(key)]
        ):
            told = ", ".join(f"{key} was {_short(there.get(key))} and is {_short(self.known.get(key))}" for key in changed[:3])
            raise StateError(f"{file.path} is of another study ({told})")
        for record in file.records:
            if record.kind == STATE:
                results = unpack(file.read(record))
                if not isinstance(results, dict):
                    raise StateError(f"{file.path} is no journal of a study")
                self._found |= results

    def _write_when_due(self) -> None:
        while not self._stopped:
            left = self._due - clock.monotonic()
            if left > 0.0:
                self._wakes.wait(min(left, 1.0))
            elif self._waiting:
                self.flush()
            else:
                self._wakes.wait(EVERY)

    def _stop(self) -> None:
        self._stopped, self._due = True, math.inf
        self._wakes.set()
        if self._writer is not None:
            self._writer.join()
            self._writer = None

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None


def _short(value: Any) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 40 else f"{text[:37]}…"
