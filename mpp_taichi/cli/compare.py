"""Compare backends: the same scene on each of them, in a process of its own: the agreement of their results, and their times.

First a certificate: forces particle by particle and trajectories over many steps against a reference in NumPy, with a verdict
"rounding" or "bug" and the number that decided it. Then a table of times, rates and shares of the peak of the device. Writes
DIR/compare.json and DIR/compare.html. The code is 4 where a backend differs by more than rounding.
"""

import argparse
import textwrap
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi import __version__
from mpp_taichi.cli import _options
from mpp_taichi.cli._reports import write_report
from mpp_taichi.cli._terminal import UsageError, output_reserved, plain, put, put_json, say
from mpp_taichi.cli.accuracy import names, span_of_time
from mpp_taichi.errors import BackendError, UnsupportedError

if TYPE_CHECKING:
    from mpp_taichi.compare.comparison import ComparisonWishes
    from mpp_taichi.scene.spec import SceneSpec

BUDGET_SECONDS = 60.0
BUG_CODE = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    _options.add_scene(parser)
    parser.add_argument(
        "--backends", type=names, metavar="A,B", help="backends to compare, of cpu,cuda,vulkan,metal,opencl,numpy; absent: all"
    )
    parser.add_argument(
        "--precisions", type=names, default=["f64", "f32"], metavar="P,Q", help="precisions to compare; absent: f64,f32"
    )
    parser.add_argument(
        "--budget", type=span_of_time, default=BUDGET_SECONDS, metavar="60s", help="wall time to aim at: 60s, 10min, 1h"
    )
    parser.add_argument("--steps", type=_options.positive_integer, metavar="N", help="most steps of the trajectories compared")
    parser.add_argument("--scaling", action="store_true", help="steps per second of generated scenes, from 2 particles on")
    parser.add_argument("--ladder", action="store_true", help="each way to sum over pairs as a row, from the plainest")
    parser.add_argument("--threads", type=_options.thread_count, metavar="N", help="of the cpu backend")
    parser.add_argument(
        "--out", type=_options.output_path, metavar="DIR", help="folder of the results; absent: out/SCENE.compare"
    )
    _options.add_journal(parser, "DIR/journal")
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Compare, print and write."""
    from mpp_taichi.cli._refusals import require_any_backend, require_room
    from mpp_taichi.cli._study_journal import study_journal, torn, went_on
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.scene.pair_forces import is_pair_force

    wishes = _wishes(arguments)
    spec = load_scene(arguments.scene, overrides=arguments.overrides)
    require_room(spec)
    require_any_backend(wishes.backends)
    if spec.rigid_entries:
        raise UnsupportedError(f"no other backend keeps the lengths of {spec.rods_named}: there is nothing to compare")
    if spec.driven_entries:
        raise UnsupportedError("no other backend moves bodies on a path: there is nothing to compare")
    if spec.changing_entries:
        raise UnsupportedError("no other backend has masses and charges that change: there is nothing to compare")
    if arguments.ladder and not any(is_pair_force(force.name) for force in spec.forces):
        raise UsageError("--ladder is of sums over pairs, and the scene has no force between all particles")
    from mpp_taichi.accuracy.budget import Budget
    from mpp_taichi.cli._signals import Interruption
    from mpp_taichi.compare.comparison import Comparison
    from mpp_taichi.compare.words import sentence
    from mpp_taichi.recorders._lock import OutputLock

    folder = arguments.out or _options.OUTPUT_FOLDER / f"{_options.output_stem(spec.source)}.compare"
    with output_reserved(arguments.json), Interruption() as interruption:
        lock = OutputLock(folder / "compare.json")
        try:
            tell = (lambda _: None) if arguments.quiet else say
            budget = Budget(arguments.budget, interruption.raise_if_any, time.perf_counter)
            with study_journal(folder / "journal", "compare", arguments, _known(spec, wishes, arguments)) as journal:
                if journal.holds:
                    tell(f"going on with {journal.path}{torn(journal)}; --fresh begins anew")
                comparison = Comparison(spec, wishes, budget, tell, journal=journal, files=folder / "work")
                comparison.run()
                found = plain(comparison.facts())
                found["known"]["mpp_taichi"] = __version__
                found["sentence"] = sentence(found)
                found["went_on"] = went_on(journal)
                found["files"] = _write(folder, found)
                journal.end()
        finally:
            lock.release()
    _report(found, arguments)
    if comparison.bugs:
        return BUG_CODE
    nothing_ran = bool(comparison.rows) and all(row.status == "missing" for row in comparison.rows)
    return BackendError.exit_code if nothing_ran else 0


def _known(spec: "SceneSpec", wishes: "ComparisonWishes", arguments: argparse.Namespace) -> dict[str, Any]:
    """What a comparison depends on, beside versions and machine."""
    return {"scene": plain(spec.resolved), "options": plain(vars(wishes)), "budget": arguments.budget}


def _write(folder: Path, found: dict[str, Any]) -> list[str]:
    """Write compare.json and compare.html."""
    from mpp_taichi.compare.report import page

    return write_report(folder, "compare", found, page(found))


def _report(found: dict[str, Any], arguments: argparse.Namespace) -> None:
    from mpp_taichi.compare.table import lines
    from mpp_taichi.compare.words import EXPLANATION, circumstances, machine

    if arguments.json:
        put_json(found)
    elif not arguments.quiet:
        key = textwrap.wrap(EXPLANATION, 110, initial_indent="  ", subsequent_indent="  ")
        put("\n".join([*lines(found["rows"]), "", *key, "", *circumstances(found), machine(found)]))
        put(f"\n{found['sentence']}")
        put(f"\nwrote {', '.join(found['files'])}")


def _wishes(arguments: argparse.Namespace) -> "ComparisonWishes":
    from mpp_taichi.compare.comparison import ALL_BACKENDS, ComparisonWishes
    from mpp_taichi.compare.course import ROUNDING

    arguments.backends = arguments.backends or list(ALL_BACKENDS)
    for option, known in {"backends": ALL_BACKENDS, "precisions": tuple(ROUNDING)}.items():
        for name in getattr(arguments, option):
            if name not in known:
                raise UsageError(f"--{option} {name}: allowed are {', '.join(known)}")
    parts = (arguments.threads, arguments.scaling, arguments.ladder, arguments.steps)
    return ComparisonWishes(arguments.backends, arguments.precisions, *parts)
