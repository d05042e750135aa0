"""Verify this machine: questions with known answers, asked of each backend that starts here, in each precision.

Hard cases, forces against an independent sum, orders and conservation of integrators, published numbers, statistics of gases:
each is solved within a bound that is derived, or refused in words. Writes DIR/verify.json and DIR/verify.html. The code is 4
where a number is beyond its bound. A verification that was cut off goes on with the same command.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._reports import write_report
from mpp_taichi.cli._terminal import UsageError, output_reserved, plain, put, put_json, say
from mpp_taichi.cli.accuracy import names
from mpp_taichi.device.availability import BACKENDS, availability
from mpp_taichi.device.thread_count import processors
from mpp_taichi.errors import BackendError, StabilityError
from mpp_taichi.precision import PRECISIONS

if TYPE_CHECKING:
    from mpp_taichi.verify.case import Case
    from mpp_taichi.verify.examination import Question
    from mpp_taichi.verify.place import Place

QUICK_PRECISIONS = {"cpu": ("f64", "f32"), "cuda": ("f32", "f64"), "vulkan": ("f32",), "metal": ("f32",)}
MOST_WORKERS = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--backend", type=names, metavar="A,B", help="of cpu,cuda,vulkan,metal; absent: all that start here")
    parser.add_argument("--precision", type=names, metavar="P,Q", help=f"of {','.join(PRECISIONS)}; absent: as the length says")
    length = parser.add_mutually_exclusive_group()
    length.add_argument(
        "--quick", action="store_true", help="what matters most, in f64 and f32, in some two minutes: the default"
    )
    length.add_argument("--full", action="store_true", help="every case in every precision, in some ten minutes")
    parser.add_argument("--only", type=names, metavar="X,Y", help="these cases, or groups of cases")
    parser.add_argument("--list", action="store_true", help="print the cases, and ask none")
    parser.add_argument(
        "--workers",
        type=_options.positive_integer,
        metavar="N",
        help="processes that ask at once; absent: one on each processor",
    )
    out = "folder of the results; absent: out/verify"
    parser.add_argument("--out", type=_options.output_path, metavar="DIR", help=out)
    _options.add_journal(parser, "DIR/journal")
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Ask, print and write."""
    from mpp_taichi.verify.catalogue import cases

    chosen = _chosen(cases(), arguments)
    if arguments.list:
        put("\n".join(f"{case.name:28} {case.group:12} {'quick' if case.quick else 'full':6} {case.title}" for case in chosen))
        return 0
    places, missing = _places(arguments)
    questions = [(case, place) for case in chosen for place in places if place.precision in case.on]
    if not questions:
        raise UsageError("verify: none of these cases is asked in these precisions")
    found = _ask(questions, missing, arguments)
    _report(found, arguments)
    return StabilityError.exit_code if found["counts"]["failed"] else 0


def _chosen(known: "list[Case]", arguments: argparse.Namespace) -> "list[Case]":
    groups, words = {case.group for case in known}, {case.name for case in known}
    for name in arguments.only or ():
        if name not in groups | words:
            raise UsageError(f"verify: --only {name}: no case and no group has this name; verify --list prints them")
    wanted = [case for case in known if arguments.only is None or {case.name, case.group} & set(arguments.only)]
    is_quick = not arguments.full and not arguments.list and not set(arguments.only or ()) & words
    return [case for case in wanted if case.quick] if is_quick else wanted


def _places(arguments: argparse.Namespace) -> "tuple[list[Place], dict[str, str]]":
    """The places, and the backends that do not start here with the reason.

    Raises:
        BackendError: a backend that was asked for does not start.
    """
    from mpp_taichi.verify.place import Place

    for name, allowed in ((each, BACKENDS) for each in arguments.backend or ()):
        if name not in allowed:
            raise UsageError(f"verify: --backend {name}: allowed are {', '.join(allowed)}")
    for name in arguments.precision or ():
        if name not in PRECISIONS:
            raise UsageError(f"verify: --precision {name}: allowed are {', '.join(PRECISIONS)}")
    reports = {backend: availability(backend) for backend in arguments.backend or BACKENDS}
    missing = {backend: report["reason"] for backend, report in reports.items() if not report["available"]}
    if arguments.backend and missing:
        backend, reason = next(iter(missing.items()))
        raise BackendError(f"{backend} does not start here: {reason}")
    found = []
    for backend in (each for each in reports if each not in missing):
        usual = PRECISIONS if arguments.full else QUICK_PRECISIONS[backend]
        found += [Place(backend, precision) for precision in arguments.precision or usual]
    return found, missing


def _ask(questions: "list[Question]", missing: dict[str, str], arguments: argparse.Namespace) -> dict[str, Any]:
    from mpp_taichi.cli._passport import keep_verdict
    from mpp_taichi.cli._signals import Interruption
    from mpp_taichi.cli._study_journal import study_journal, torn, went_on
    from mpp_taichi.recorders._lock import OutputLock
    from mpp_taichi.verify.examination import Examination
    from mpp_taichi.verify.findings import facts

    folder: Path = arguments.out or _options.OUTPUT_FOLDER / "verify"
    workers = arguments.workers or min(processors(), MOST_WORKERS)
    tell = (lambda _: None) if arguments.quiet else say
    with output_reserved(arguments.json), Interruption() as interruption:
        lock = OutputLock(folder / "verify.json")
        try:
            with study_journal(folder / "journal", "verify", arguments, {}) as journal:
                if journal.holds:
                    tell(f"going on with {journal.path}{torn(journal)}; --fresh begins anew")
                results = Examination(questions, journal, folder, tell).run(workers, interruption.raise_if_any)
                found = plain(facts(questions, results, missing))
                found["went_on"] = went_on(journal)
                found["files"] = _write(folder, found)
                if arguments.only is None:
                    keep_verdict(found, length="full" if arguments.full else "quick")
                journal.end()
        finally:
            lock.release()
    return found


def _write(folder: Path, found: dict[str, Any]) -> list[str]:
    """Write verify.json and verify.html."""
    from mpp_taichi.verify.page import page

    return write_report(folder, "verify", found, page(found))


def _report(found: dict[str, Any], arguments: argparse.Namespace) -> None:
    from mpp_taichi.verify.findings import lines

    if arguments.json:
        put_json(found)
    elif not arguments.quiet:
        put("\n".join([*lines(found), "", f"{found['sentence']}", f"\nwrote {', '.join(found['files'])}"]), verdicts=True)
