"""Worker: runs chunks of a sweep in a process of its own; `python -m mpp_taichi.sweep.worker` answers lines."""

import logging
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.compare.answering import answer_lines
from mpp_taichi.sweep.chunk import columns_of, write
from mpp_taichi.sweep.replicas import Bench, MemberDevice
from mpp_taichi.sweep.runner import run_members
from mpp_taichi.sweep.store import SweepStore, opened

_stores: dict[str, SweepStore] = {}
_benches: dict[MemberDevice, Bench] = {}


def do_chunks(folder: str, numbers: list[int], threads: int | None = 1) -> dict[str, Any]:
    """Run chunks together, those that are not done, and write each; the counts of their rows by status."""
    store = _stores.get(folder) or _stores.setdefault(folder, opened(Path(folder)))
    found = {number: store.columns(number) for number in numbers}
    missing = [number for number, columns in found.items() if columns is None]
    if missing:
        device = MemberDevice(store.device["backend"], store.device["precision"], threads)
        bench = _benches.get(device) or _benches.setdefault(device, Bench(device))
        members = np.concatenate([store.members(number) for number in missing])
        with component.files_stay():
            rows = run_members(members.tolist(), store.plan.values(members), store.resolved, store.source, bench, store.own)
        begin = 0
        for number in missing:
            end = begin + len(store.members(number))
            columns = columns_of(rows[begin:end], len(store.measures))
            write(store.path(number), columns)
            found[number], begin = columns, end
    statuses = np.concatenate([columns.status for columns in found.values() if columns is not None])
    return {"numbers": numbers, "statuses": np.bincount(statuses).tolist()}


def main() -> None:
    """Answer lines `{"do": "chunks", "folder": …, "numbers": …, "threads": …}` until standard input ends."""
    logging.getLogger("mpp_taichi").setLevel(logging.ERROR)  # the same warning of each member

    def answer(line: dict[str, Any]) -> dict[str, Any]:
        return do_chunks(line["folder"], line["numbers"], line["threads"])

    answer_lines(answer)


if __name__ == "__main__":
    main()
