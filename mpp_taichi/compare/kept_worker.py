"""Kept worker: a worker whose answers are kept in a journal, so that a comparison that was cut off asks for none of them again.

The answer to a request is known by the row, the command, the fields of the request with the contents of the files that they
name, and how often this was asked before. Failures are not kept: what failed is tried again.
"""

import copy
import hashlib
import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.archive.journal import Journal
from mpp_taichi.compare.process import WorkerProcess

# Of a request: where its answer goes, and a limit of time, which depends on the time that is left.
NOT_ASKED = ("to", "seconds")
PREPARING = ("build", "calibrate")  # requests that a worker needs before others
MOST_BYTES = 1 << 26  # of the arrays of an answer that is kept; larger ones are asked for again


class KeptWorker:
    """A worker of one row, which is started when a request comes whose answer is not known.

    started   whether it was started
    """

    def __init__(self, name: str, begin: Callable[[], WorkerProcess], journal: Journal, kept: Callable[[], None]) -> None:
        """`begin` starts the worker; `kept` is called after an answer was kept, for the time that it took."""
        self._name, self._begin, self._journal, self._kept = name, begin, journal, kept
        self._process: WorkerProcess | None = None
        self._asked: Counter[str] = Counter()
        self._built = ""  # a digest of the scene that was built last
        self._before: dict[str, dict[str, Any]] = {}  # the last requests of PREPARING
        self.started = False

    def ask(self, command: str, within: float, **fields: Any) -> dict[str, Any]:
        """The answer to a request, from the journal or from the worker.

        Raises:
            WorkerError: see `WorkerProcess.ask`.
        """
        key = f"{self._name}: {command} {self._built} {digest(fields)}"
        self._asked[key] += 1
        key = f"{key} {self._asked[key]}"
        known = self._journal.get(key)
        answer: dict[str, Any]
        if known is None:
            answer = self._asked_now(key, command, within, fields)
        else:
            answer = copy.deepcopy(known["answer"])
            if known["arrays"]:
                np.savez(fields["to"], **known["arrays"])
        if command in PREPARING:
            self._before[command] = fields
        if command == "build":
            self._built = digest(fields)
        return answer

    def _asked_now(self, key: str, command: str, within: float, fields: dict[str, Any]) -> dict[str, Any]:
        answer = self._running(within).ask(command, within, **fields)
        arrays = {}
        if "to" in fields:
            with np.load(fields["to"], allow_pickle=False) as found:
                arrays = {name: found[name] for name in found.files}
        if sum(each.nbytes for each in arrays.values()) <= MOST_BYTES:
            self._journal.put(key, {"answer": copy.deepcopy(answer), "arrays": arrays})  # it is written later
            self._kept()
        return answer

    def _running(self, within: float) -> WorkerProcess:
        """The worker, which has been told what a worker was told before it."""
        if self._process is None:
            self._process, self.started = self._begin(), True
            for command, fields in self._before.items():
                self._process.ask(command, within, **fields)
        return self._process

    def ask_to_end(self) -> None:
        """See `WorkerProcess`."""
        if self._process is not None:
            self._process.ask_to_end()

    def end(self) -> None:
        """See `WorkerProcess`."""
        if self._process is not None:
            self._process.end()

    def kill(self) -> None:
        """See `WorkerProcess`."""
        if self._process is not None:
            self._process.kill()


def digest(fields: dict[str, Any]) -> str:
    """A digest of the fields of a request; of a file, its contents count, and not its name."""
    found = hashlib.sha256()
    for name, value in sorted(fields.items()):
        if name in NOT_ASKED:
            continue
        path = Path(value) if isinstance(value, str) and value else None
        text = path.read_bytes() if path is not None and path.is_file() else json.dumps(value, sort_keys=True).encode()
        found.update(name.encode() + b"=" + text + b";")
    return found.hexdigest()[:16]
