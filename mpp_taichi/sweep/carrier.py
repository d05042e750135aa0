"""Carrier: processes that share the chunks of a sweep. It only carries: whether a chunk is done, the store alone knows."""

import contextlib
import queue
import tempfile
import threading
import time as clock
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from mpp_taichi.compare.process import WorkerError, WorkerProcess
from mpp_taichi.device.thread_count import start_thread

MODULE = "mpp_taichi.sweep.worker"
LOOK_SECONDS = 0.05
LONGEST_SECONDS = 7 * 24 * 3600.0  # of one chunk: the run of a single member may take days
TRIES = 2  # of a chunk whose process has died


def batches(numbers: Sequence[int], together: int, workers: int) -> Iterator[list[int]]:
    """Chunks for one launch after the other: first one, soon many, at the end few, so that all workers end together."""
    taken, waiting = 0, list(numbers)
    while taken < len(waiting):
        count = min(together, taken + 1, -(-(len(waiting) - taken) // (2 * workers)))
        yield waiting[taken : taken + count]
        taken += count


class Processes:
    """Worker processes on this machine, which stay until `close`."""

    def __init__(self, folder: Path, count: int, threads: int, *, together: int = 1) -> None:
        """Nothing is started yet; `threads` are those of each process, which runs up to `together` chunks in one launch."""
        self.folder, self.count, self.threads, self.together = folder, count, threads, together
        self._stopped = threading.Event()
        self._lock = threading.Lock()
        self._error: Exception | None = None
        self._logs: tempfile.TemporaryDirectory[str] | None = None
        self._idle = list[WorkerProcess]()
        self._batches: Iterator[list[int]] = iter(())

    def carry(self, numbers: Sequence[int], done: Callable[[dict[str, Any]], None], look: Callable[[], None]) -> None:
        """Run these chunks; `done` is told of each in this thread, `look` is called again and again and may raise.

        Raises:
            WorkerError: a chunk has ended its process twice.
        """
        self._batches = batches(numbers, self.together, self.count)
        finished = queue.SimpleQueue[dict[str, Any]]()
        threads = [threading.Thread(target=self._work, args=(finished,), daemon=True) for _ in range(self.count)]
        self._logs = self._logs or tempfile.TemporaryDirectory(prefix="mpp_taichi_sweep_")
        ended = False
        try:
            for thread in threads:
                start_thread(thread)
            while any(thread.is_alive() for thread in threads) or not finished.empty():
                look()
                with contextlib.suppress(queue.Empty):
                    done(finished.get(timeout=LOOK_SECONDS))
            ended = True
        finally:
            if not ended:
                self._stopped.set()
            for thread in threads:
                if thread.ident is not None:
                    thread.join()
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """End the processes: at once where `carry` was cut off."""
        while self._idle:
            self._idle.pop().leave(at_once=self._stopped.is_set())
        if self._logs is not None:
            self._logs.cleanup()

    def _next(self) -> list[int]:
        with self._lock:
            return next(self._batches, [])

    def _work(self, finished: "queue.SimpleQueue[dict[str, Any]]") -> None:
        with self._lock:
            worker = self._idle.pop() if self._idle else None
        try:
            while not self._stopped.is_set():
                numbers = self._next()
                if not numbers:
                    break
                for attempt in range(TRIES):
                    try:
                        assert self._logs is not None
                        worker = worker or WorkerProcess(Path(self._logs.name), None, self._look, module=MODULE)
                        asked = {"folder": str(self.folder.absolute()), "numbers": numbers, "threads": self.threads}
                        finished.put(worker.ask("chunks", LONGEST_SECONDS, **asked))
                        break
                    except WorkerError as error:
                        if worker is not None:
                            worker.kill()
                        worker = None
                        if self._stopped.is_set():
                            return
                        if attempt == TRIES - 1:
                            raise WorkerError(f"chunk {numbers[0]} of the sweep: {error}") from error
                        clock.sleep(LOOK_SECONDS)
        except Exception as error:  # `carry` raises it in its own thread
            self._error = error
            self._stopped.set()
        finally:
            if worker is not None:
                with self._lock:
                    self._idle.append(worker)

    def _look(self) -> None:
        if self._stopped.is_set():
            raise WorkerError("the sweep was ended")
