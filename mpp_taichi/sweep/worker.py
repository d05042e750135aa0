"""Worker: runs chunks of a sweep in a process of its own; `python -m mpp_taichi.sweep.worker` answers lines."""

import logging
import time as clock
from pathlib import Path
from typing import Any

from mpp_taichi import component
from mpp_taichi.compare.answering import answer_lines
from mpp_taichi.sweep.chunk import columns_of, write
from mpp_taichi.sweep.replicas import Bench, Device
from mpp_taichi.sweep.runner import run_members
from mpp_taichi.sweep.store import Store, opened

_stores: dict[str, Store] = {}
_benches: dict[Device, Bench] = {}


def do_chunk(folder: str, number: int, threads: int | None = 1) -> dict[str, Any]:
    """Run a chunk, unless it is done, and write it; the counts of its rows by status, and the seconds that it took."""
    store = _stores.get(folder) or _stores.setdefault(folder, opened(Path(folder)))
    began = clock.perf_counter()
    columns = store.columns(number)
    if columns is None:
        device = Device(store.device["backend"], store.device["precision"], threads)
        bench = _benches.get(device) or _benches.setdefault(device, Bench(device))
        members = store.members(number)
        with component.files_stay():
            rows = run_members(members.tolist(), store.plan.values(members), store.resolved, store.source, bench, store.own)
        columns = columns_of(rows, len(store.measures))
        write(store.path(number), columns)
    statuses = [int((columns.status == code).sum()) for code in range(int(columns.status.max()) + 1)]
    return {"number": number, "statuses": statuses, "seconds": clock.perf_counter() - began}


def main() -> None:
    """Answer lines `{"do": "chunk", "folder": …, "number": …, "threads": …}` until standard input ends."""
    logging.getLogger("mpp_taichi").setLevel(logging.ERROR)  # the same warning of each member

    def answer(line: dict[str, Any]) -> dict[str, Any]:
        return do_chunk(line["folder"], line["number"], line["threads"])

    answer_lines(answer)


if __name__ == "__main__":
    main()
