"""Examination: all questions of a report, asked by workers, each of which examines one place after the other."""

import queue
import threading
import time as clock
from collections.abc import Callable, Sequence
from pathlib import Path

from mpp_taichi.archive.journal import Journal
from mpp_taichi.compare.process import WorkerError, WorkerProcess
from mpp_taichi.device.thread_count import start_thread
from mpp_taichi.verify.case import Case
from mpp_taichi.verify.case_result import CaseResult, failed
from mpp_taichi.verify.place import Place

MODULE = "mpp_taichi.verify.worker"
LONGEST_SECONDS = 300.0  # of one case; the process of a case that takes longer is killed
LOOK_SECONDS = 0.05
Question = tuple[Case, Place]


class Examination:
    """Results of questions, in the order in which they were given; what a `journal` knows is not asked again."""

    def __init__(self, questions: Sequence[Question], journal: Journal, files: Path, tell: Callable[[str], None]) -> None:
        """Prepare; `files` is a folder for what the workers print, `tell` is given a line for each result."""
        self._questions, self._journal, self._files, self._tell = list(questions), journal, files, tell
        self.results: dict[str, CaseResult] = {}
        self._stopped = threading.Event()
        self._error: Exception | None = None
        self._lock = threading.Lock()

    def run(self, workers: int, look: Callable[[], None]) -> list[CaseResult]:
        """Ask; `look` is called again and again in this thread and may raise, which ends the workers.

        Raises:
            CapacityError: the system starts no thread.
        """
        waiting = self._by_place()
        threads = [threading.Thread(target=self._ask_all, args=(waiting,), daemon=True) for _ in range(workers)]
        try:
            for thread in threads:
                start_thread(thread)
            while any(thread.is_alive() for thread in threads):
                look()
                clock.sleep(LOOK_SECONDS)
        finally:
            self._stopped.set()
            for thread in threads:
                if thread.ident is not None:
                    thread.join()
        if self._error is not None:
            raise self._error
        return [self.results[key(question)] for question in self._questions]

    def _by_place(self) -> "queue.SimpleQueue[list[Question]]":
        """The questions that the journal does not know, those of one place together: a worker starts a device once."""
        places: dict[Place, list[Question]] = {}
        for question in self._questions:
            known = self._journal.get(key(question))
            if known is not None:
                self.results[key(question)] = CaseResult(**known)
            else:
                places.setdefault(question[1], []).append(question)
        waiting: queue.SimpleQueue[list[Question]] = queue.SimpleQueue()
        for group in sorted(places.values(), key=lambda each: -_weight(each)):
            waiting.put(group)
        return waiting

    def _ask_all(self, waiting: "queue.SimpleQueue[list[Question]]") -> None:
        """The work of a thread: places, until none is left."""
        while not self._stopped.is_set():
            try:
                group = waiting.get_nowait()
            except queue.Empty:
                return
            try:
                self._ask_place(group)
            except Exception as error:  # `run` raises it in its own thread
                self._error = error
                self._stopped.set()

    def _ask_place(self, group: Sequence[Question]) -> None:
        worker: WorkerProcess | None = None
        try:
            for case, place in group:
                began = clock.perf_counter()
                try:
                    worker = worker or WorkerProcess(self._files, None, self._look, module=MODULE)
                    asked = {"case": case.name, "backend": place.backend, "precision": place.precision}
                    result = CaseResult(**worker.ask("ask", LONGEST_SECONDS, **asked, threads=place.threads))
                except WorkerError as error:  # it has crashed, or was killed: the next case has a new process
                    if self._stopped.is_set():
                        return
                    if worker is not None:
                        worker.kill()
                    worker, result = None, failed(case, place, str(error), clock.perf_counter() - began)
                self._keep((case, place), result)
        finally:
            if worker is not None:
                worker.leave(at_once=self._stopped.is_set())

    def _look(self) -> None:
        if self._stopped.is_set():
            raise WorkerError("the examination was ended")

    def _keep(self, question: Question, result: CaseResult) -> None:
        with self._lock:
            self.results[key(question)] = result
            self._journal.put(key(question), result.facts())
            number = f"{len(self.results)}/{len(self._questions)}"
            self._tell(f"{number}  {result.backend} {result.precision}  {result.case}: {result.told}")


def key(question: Question) -> str:
    """The name of a question in a journal."""
    case, place = question
    return f"{case.name} {place.backend} {place.precision} {place.threads or ''}".strip()


def _weight(group: Sequence[Question]) -> float:
    """How long a place will take, roughly: software devices compile slowly, and so do numbers in two parts."""
    place = group[0][1]
    return len(group) * (1.0 if place.backend == "cpu" else 3.0) * (2.0 if place.precision == "df64" else 1.0)
