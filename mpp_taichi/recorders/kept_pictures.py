"""Kept pictures: the pictures of a film, kept without loss for the archive of a run, besides going into the film.

A film that goes on is encoded again from its first picture. Only so it has the frames of a film that was never cut off: an
encoder chooses each frame by those around it, and its state cannot be saved.
"""

import math
import queue
import threading
from collections.abc import Iterator, Mapping
from typing import Any, Protocol

import numpy as np

from mpp_taichi.archive.changed_words import change, difference, padded, words_of
from mpp_taichi.archive.compressed import decompressed
from mpp_taichi.device.thread_count import start_thread
from mpp_taichi.errors import OutputError, StateError

QUEUED = 4  # pictures that wait to be compared
MOST_PENDING = 1 << 31  # bytes


class FilmFile(Protocol):
    """The film: `VideoRecorder`."""

    path: Any
    size: tuple[int, int]

    def write(self, picture: np.ndarray) -> None:
        """Add one picture."""


class KeptPictures:
    """Hands pictures on to a film, and keeps each as what has changed since the one before, found in a thread.

    pending   bytes of kept pictures that no record holds yet
    """

    def __init__(self, film: FilmFile) -> None:
        """Nothing is kept yet."""
        self.film, self.pending, self.frame_count = film, 0, 0
        self._chunks: list[list[np.ndarray]] = []
        self._shape = (film.size[1], film.size[0], 3)
        self._last = padded(film.size[1] * film.size[0] * 3)
        self._queue: queue.Queue[np.ndarray | None] = queue.Queue(QUEUED)
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None

    def begin_anew(self) -> None:
        """Keep every picture from now on."""
        thread = threading.Thread(target=self._work, name="pictures for the archive", daemon=True)
        start_thread(thread)
        self._thread = thread

    def write(self, picture: np.ndarray) -> None:
        """Add one picture: uint8, shape (height, width, 3); it must not be changed afterwards."""
        self.film.write(picture)
        self.frame_count += 1
        if self._thread is not None:
            self._queue.put(picture)

    def news(self) -> list[list[np.ndarray]]:
        """The kept pictures since the last record.

        Raises:
            OutputError: memory is full.
        """
        self._queue.join()
        if self._failure is not None:
            raise OutputError(f"{self.film.path}: its pictures cannot be kept for the archive: {self._failure!r}")
        found, self._chunks, self.pending = self._chunks, [], 0
        return found

    def at_record(self) -> dict[str, Any]:
        """The number of pictures."""
        return {"frame_count": self.frame_count}

    def stop(self) -> None:
        """Keep no more pictures; harmless when called twice."""
        thread, self._thread = self._thread, None
        if thread is not None:
            self._queue.put(None)
            thread.join()
        self._chunks, self.pending = [], 0

    def go_on(self, simulation: Any, saved: Mapping[str, Any], news: Iterator[list[Any]]) -> None:
        """Hand the kept pictures to the new film, and keep those that follow.

        Raises:
            StateError: pictures are missing or damaged.
            OutputError: the encoder failed.
        """
        for chunks in news:
            for chunk in chunks:
                self._change(chunk)
                size = math.prod(self._shape)
                self.film.write(self._last.view(np.uint8)[:size].reshape(self._shape).copy())
                self.frame_count += 1
        if self.frame_count != saved["frame_count"]:
            raise StateError(f"it holds {self.frame_count:,} of {saved['frame_count']:,} pictures of {self.film.path}")
        self.begin_anew()

    def _change(self, chunk: Any) -> None:
        """Go from one kept picture to the next; in format 1 of archives it is the XOR of both, compressed."""
        try:
            if isinstance(chunk, np.ndarray):
                xor = decompressed(chunk, math.prod(self._shape))
                self._last = self._last ^ words_of(np.frombuffer(xor, np.uint8))
            else:
                change(self._last, chunk)
        except (ValueError, TypeError, AttributeError, IndexError) as error:
            raise StateError(f"picture {self.frame_count:,} of {self.film.path} is damaged") from error

    def _work(self) -> None:
        """Keep pictures until the end; after a failure take them and drop them, so that no caller waits for it."""
        while (picture := self._queue.get()) is not None:
            try:
                if self._failure is None:
                    self._keep(picture)
            except Exception as error:  # whatever it is: a thread that ended would let the film wait for ever
                self._failure, self._chunks, self.pending = error, [], 0
            finally:
                self._queue.task_done()
        self._queue.task_done()

    def _keep(self, picture: np.ndarray) -> None:
        words = words_of(picture)
        chunk = difference(words, self._last)
        self._last = words
        self._chunks.append(chunk)
        self.pending += sum(part.nbytes for part in chunk)
        if self.pending > MOST_PENDING:
            raise OverflowError("too many between two steps")
