"""Dask carrier: workers of a Dask cluster that share the chunks of a sweep, through the executor of its client.

Every worker of Dask keeps a process of this program, as a simulation stays in one thread and a driver may crash it. The folder
of the sweep must be reachable by all workers under the same path.
"""

import importlib.util
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from pathlib import Path
from typing import Any

from mpp_taichi.compare.process import WorkerError, WorkerProcess
from mpp_taichi.errors import BackendError, MissingPackageError
from mpp_taichi.sweep.carrier import LONGEST_SECONDS, LOOK_SECONDS, MODULE, TRIES, batches

LOCAL = "local"
CONNECT_SECONDS = 20

_workers: list[WorkerProcess] = []
"""The process of this worker of Dask."""


class DaskWorkers:
    """The workers of a cluster at an address, tcp://host:port, or `local:n`: n workers on this machine."""

    def __init__(self, folder: Path, address: str, threads: int, *, together: int = 1) -> None:
        """Nothing is started yet; `threads` are those of each process.

        Raises:
            MissingPackageError: this Python has no Dask.
        """
        if importlib.util.find_spec("distributed") is None:
            raise MissingPackageError(f"--dask needs the package distributed: {sys.executable} -m pip install distributed")
        self.folder, self.address, self.threads, self.together = folder.absolute(), address, threads, together
        self._client: Any = None
        self._cluster: Any = None

    def carry(self, numbers: Sequence[int], done: Callable[[dict[str, Any]], None], look: Callable[[], None]) -> None:
        """Run these chunks; `done` is told of each in this thread, `look` is called again and again and may raise.

        Raises:
            BackendError: there is no cluster at this address.
            WorkerError: a chunk has ended its process twice.
        """
        client = self._connected()
        executor = client.get_executor(pure=False, retries=0)
        workers = max(1, len(client.scheduler_info()["workers"]))
        pending = {
            executor.submit(in_own_process, str(self.folder), batch, self.threads)
            for batch in batches(numbers, self.together, workers)
        }
        while pending:
            look()
            finished, pending = wait(pending, timeout=LOOK_SECONDS, return_when=FIRST_COMPLETED)
            for each in finished:
                done(each.result())

    def _connected(self) -> Any:
        from distributed import Client, LocalCluster

        if self._client is None:
            kind, _, count = self.address.partition(":")
            if kind == LOCAL:
                self._cluster = LocalCluster(n_workers=int(count or 2), threads_per_worker=1, dashboard_address=None)
            try:
                self._client = Client(self._cluster or self.address, timeout=CONNECT_SECONDS)
            except (OSError, ValueError, TimeoutError) as error:
                raise BackendError(f"no Dask cluster at {self.address}: {' '.join(str(error).split())}") from None
        return self._client

    def close(self) -> None:
        """Leave the cluster; a cluster on this machine ends."""
        for each in (self._client, self._cluster):
            if each is not None:
                each.close()


def in_own_process(folder: str, numbers: list[int], threads: int) -> dict[str, Any]:
    """Run chunks by the process that this worker of Dask keeps, and start it where there is none."""
    for attempt in range(TRIES):
        try:
            if not _workers:
                _workers.append(WorkerProcess(Path(tempfile.gettempdir()), None, lambda: None, module=MODULE))
            return _workers[0].ask("chunks", LONGEST_SECONDS, folder=folder, numbers=numbers, threads=threads)
        except WorkerError:
            while _workers:
                _workers.pop().kill()
            if attempt == TRIES - 1:
                raise
    raise AssertionError("unreachable")
