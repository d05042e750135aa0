"""Sweep: many copies of a scene with other numbers, as a table and a picture; called again it does only what is missing.

The scene's block `sweep:`, or --vary and --measure, say which keys vary and which quantities are measured. Members are run side
by side in chunks, by processes that share them; each chunk is kept in FOLDER/chunks as soon as it is done, coarse to fine.
Members that break down or are refused are rows with a status: the sweep goes on, and the code is 0. `run FOLDER --member N`
runs a member by itself.
"""

import argparse
import contextlib
import shutil
import time as clock
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._slurm import slurm_script
from mpp_taichi.cli._sweep_options import add_plan
from mpp_taichi.cli._sweep_store import asked_for
from mpp_taichi.cli._terminal import UsageError, output_reserved, put, put_json, say
from mpp_taichi.device.thread_count import processors
from mpp_taichi.precision import PRECISIONS

if TYPE_CHECKING:
    from mpp_taichi.sweep.cost import Cost
    from mpp_taichi.sweep.results import SweepResults
    from mpp_taichi.sweep.store import SweepStore

MOST_WORKERS = 64


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    _options.add_scene(parser)
    add_plan(parser)
    _options.add_length(parser)
    group = parser.add_argument_group("where and how")
    group.add_argument("--backend", default="cpu", choices=("cpu", "cuda", "vulkan", "metal"), help="device that computes")
    group.add_argument("--precision", choices=PRECISIONS, help="f64 on the CPU and f32 elsewhere when absent")
    told = "processes that share the chunks; absent: one on each processor, or one on a GPU"
    group.add_argument("--workers", type=_options.positive_integer, metavar="N", help=told)
    told = "only the k-th of n parts, for an array of jobs or several computers that share the folder"
    group.add_argument("--part", type=_part, metavar="k/n", help=told)
    told = "workers of a Dask cluster, tcp://HOST:PORT, or local:N, in place of processes; the folder must be shared"
    group.add_argument("--dask", type=_dask, metavar="ADDRESS", help=told)
    told = "print the script of an array of N jobs for SLURM, each of which runs a part, and run nothing"
    group.add_argument("--slurm", type=_options.positive_integer, metavar="N", help=told)
    parser.add_argument("--out", type=_options.output_path, metavar="FOLDER", help="absent: out/SCENE.sweep")
    parser.add_argument(
        "--chunk", type=_options.positive_integer, metavar="N", help="members of a chunk; absent: some 30 s of work"
    )
    parser.add_argument("--dry-run", action="store_true", help="print members, chunks, time and memory, and run nothing")
    parser.add_argument("--fresh", action="store_true", help="remove the folder's chunks, and begin anew")
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Plan, run what is missing, and write table and pictures."""
    with output_reserved(arguments.json):
        store, cost = asked_for(arguments)
        if arguments.slurm is not None:
            if store.sweep.refine is not None:
                raise UsageError("sweep: --slurm: the rounds of a refinement wait for each other; use --dask, or no --refine")
            put(slurm_script(arguments.words, arguments.slurm, store.folder), verdicts=False)
            return 0
        if arguments.dry_run:
            return _tell_cost(store, cost, arguments)
        began = clock.perf_counter()
        ran = _run(store, cost, arguments)
        results, files = finish(store, done_by_part=arguments.part is not None)
    _report(store, results, files, ran, clock.perf_counter() - began, arguments)
    return 0


def _tell_cost(store: "SweepStore", cost: "Cost", arguments: argparse.Namespace) -> int:
    from mpp_taichi.sweep.structure import why_alone

    workers = _workers(arguments)
    seconds, size = cost.seconds / min(workers, cost.chunks), cost.bytes * min(workers, cost.chunks)
    alone = why_alone(store.scene)
    found = {
        "folder": str(store.folder),
        "members": cost.members,
        "shape": list(store.plan.shape),
        "chunks": store.chunk_count,
        "members_per_chunk": store.chunk,
        "measures": store.measures,
        "side_by_side": not alone,
        "reason": alone,
        "workers": workers,
        "seconds": round(seconds, 1),
        "bytes": size,
        "status": "ok",
        "exit_code": 0,
    }
    if arguments.json:
        put_json(found)
        return 0
    way = f"one after the other: {alone}" if alone else "side by side, one thread each"
    put(
        f"{cost.members:,} members ({' × '.join(f'{size:,}' for size in store.plan.shape)}) in {store.chunk_count:,} chunks of "
        f"{store.chunk:,}, {way}\nsome {_time(seconds)} with {workers} processes, {size / 2**20:,.0f} MiB; "
        f"results in {store.folder}"
    )
    return 0


def _run(store: "SweepStore", cost: "Cost", arguments: argparse.Namespace) -> int:
    """Run the chunks that are missing; the number of members that were run."""
    from mpp_taichi.cli._refusals import require_any_backend
    from mpp_taichi.cli._signals import Interruption
    from mpp_taichi.sweep.progress import Progress

    mine = [] if arguments.fresh else _part_of(store.missing(), arguments.part)
    if arguments.dask is None and (arguments.fresh or mine):  # the workers of Dask have devices of their own
        require_any_backend([arguments.backend])
    if arguments.fresh:
        shutil.rmtree(store.folder / "chunks", ignore_errors=True)
        mine = _part_of(store.missing(), arguments.part)
    store.save()
    if not mine:
        return 0
    tell = (lambda _: None) if arguments.quiet else say
    ran = 0
    with Interruption() as interruption, contextlib.closing(_carrier(store, cost, arguments)) as carrier:
        while mine:  # more than once for the rounds of a refinement
            progress = Progress(store, mine, tell, goes_on=ran > 0)
            try:
                carrier.carry(mine, progress.done, interruption.raise_if_any)
            except BaseException:
                progress.picture()
                tell(f"the chunks that are done are kept in {store.folder}; the same command goes on")
                raise
            ran += progress.members
            mine = _part_of(store.missing(), arguments.part)
    return ran


def _part_of(numbers: list[int], part: tuple[int, int] | None) -> list[int]:
    """The chunks of these that this call runs."""
    return numbers if part is None else [number for number in numbers if number % part[1] == part[0] - 1]


def _carrier(store: "SweepStore", cost: "Cost", arguments: argparse.Namespace) -> Any:
    """What carries the chunks."""
    from mpp_taichi.sweep.carrier import Processes

    if arguments.dask is not None:
        from mpp_taichi.sweep.dask_carrier import DaskWorkers

        return DaskWorkers(store.folder, arguments.dask, 1, together=cost.together)
    return Processes(store.folder, _workers(arguments), 1, together=cost.together)


def finish(store: "SweepStore", *, done_by_part: bool) -> "tuple[SweepResults, list[Path]]":
    """Write the table and the pictures of what is done."""
    from mpp_taichi.errors import OutputError
    from mpp_taichi.recorders._lock import OutputLock
    from mpp_taichi.sweep.progress import held
    from mpp_taichi.sweep.results import SweepResults

    results = SweepResults(store)
    if done_by_part and not results.is_complete:
        return results, []
    try:
        lock = OutputLock(store.folder / "members.csv")
    except OutputError as error:
        if not done_by_part:
            raise
        say(f"{error}; it has the same rows")
        return results, []
    with held(lock):
        return results, _files_of(results, store.folder)


def _files_of(results: "SweepResults", folder: Path) -> list[Path]:
    from mpp_taichi.sweep.page import write_page
    from mpp_taichi.sweep.picture import draw
    from mpp_taichi.sweep.tables import write_csv, write_netcdf, write_parquet

    files = [folder / "members.csv"]
    write_csv(results, files[0])
    optional = {"sweep.nc": write_netcdf, "members.parquet": write_parquet}
    files += [folder / name for name, write in optional.items() if write(results, folder / name)]
    files += draw(results, folder)
    return [*files, folder / "index.html"] if write_page(results, folder / "index.html") else files


def _report(
    store: "SweepStore", results: "SweepResults", files: list[Path], ran: int, seconds: float, arguments: argparse.Namespace
) -> None:
    counts = results.counts()
    if arguments.json:
        put_json(
            {
                "folder": str(store.folder),
                "members": results.count,
                "shape": list(results.shape),
                "measures": results.names,
                "statuses": counts,
                "ran": ran,
                "seconds": round(seconds, 3),
                "files": [str(path) for path in files],
                "status": "ok",
                "exit_code": 0,
            }
        )
    elif not arguments.quiet:
        told = ", ".join(f"{number:,} {word}" for word, number in counts.items())
        put(f"{results.count:,} members: {told}; {ran:,} of them run now, in {_time(seconds)}")
        put(
            f"wrote {', '.join(map(str, files))}"
            if files
            else f"the other parts are missing; {store.folder} holds what is done"
        )


def _workers(arguments: argparse.Namespace) -> int:
    if arguments.workers is not None:
        return int(min(arguments.workers, MOST_WORKERS))
    return min(processors(), MOST_WORKERS) if arguments.backend == "cpu" else 1


def _part(text: str) -> tuple[int, int]:
    number, slash, parts = text.partition("/")
    if not (slash and number.isdecimal() and parts.isdecimal() and 1 <= int(number) <= int(parts)):
        raise argparse.ArgumentTypeError(f"{text!r} must be k/n with k from 1 to n, as 2/8")
    return int(number), int(parts)


def _dask(text: str) -> str:
    kind, _, rest = text.partition(":")
    if not ((kind == "local" and rest.isdecimal() and 1 <= int(rest) <= MOST_WORKERS) or ("://" in text and rest.strip("/"))):
        raise argparse.ArgumentTypeError(f"{text!r} must be tcp://HOST:PORT, or local:N with N from 1 to {MOST_WORKERS}")
    return text


def _time(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"
