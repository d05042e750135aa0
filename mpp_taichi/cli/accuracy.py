"""Report the cost of accuracy in time: a scene run by many methods, steps and precisions, each measured against a reference.

Prints a table with the front of error and time marked and a sentence that sums it up, and writes DIR/accuracy.json and
DIR/accuracy.html, a page with plots that needs no network. Runs that are done are kept in DIR: a second call goes on where
the first one ended.
"""

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi import __version__, component
from mpp_taichi.cli import _options
from mpp_taichi.cli._reports import write_report
from mpp_taichi.cli._terminal import UsageError, output_reserved, put, put_json, say
from mpp_taichi.precision import PRECISIONS

if TYPE_CHECKING:
    from mpp_taichi.accuracy.budget import Budget
    from mpp_taichi.accuracy.phase_studies import PhaseStudies
    from mpp_taichi.accuracy.problem import Problem
    from mpp_taichi.accuracy.study import Study, StudyWishes
    from mpp_taichi.scene.spec import SceneSpec

BUDGET_SECONDS, SMALL_BUDGET_SECONDS = 60.0, 20.0
TARGET = 1e-6
DEFAULT_PRECISIONS, DEFAULT_BACKENDS = ("f64", "f32"), ("cpu",)
OWN_QUANTITIES = {"positions": "position", "energy": "energy"}  # words of --of, and the quantities of a study
UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    _options.add_scene(parser)
    parser.add_argument(
        "--budget",
        type=span_of_time,
        metavar="60s",
        help="processor time that the study may take, of all threads together: 60s, 10min, 1h; absent: 60s, or 20s "
        "for a scene in one phase whose own run takes less than 10 ms and whose positions are compared",
    )
    parser.add_argument(
        "--target",
        type=_options.positive_number,
        metavar="E",
        help="largest allowed error, for which the report names a method; absent: 1e-6",
    )
    parser.add_argument(
        "--of",
        metavar="NAME",
        help="quantity whose error is compared: any quantity of expect:, such as orbital_period; or energy, or positions; "
        "absent: positions at the end, and for contacts that make them meaningless the first entry of expect:",
    )
    parser.add_argument(
        "--until", type=_options.positive_number, metavar="T", help="simulated time; the scene's own when absent"
    )
    parser.add_argument(
        "--integrators",
        type=names,
        metavar="A,B",
        help="methods to try, such as leapfrog or leapfrog+tree-1e-3; absent: all suitable methods",
    )
    parser.add_argument(
        "--precisions",
        type=names,
        metavar="P,Q",
        help="precisions to try, of f64,df64,ds,f32c,f32; absent: f64,f32",
    )
    parser.add_argument(
        "--backends",
        type=names,
        metavar="B,C",
        help="backends to try, such as cpu or cpu,vulkan; absent: cpu, and then the chosen setting on the others that start",
    )
    parser.add_argument(
        "--out", type=_options.output_path, metavar="DIR", help="folder of the results; absent: out/SCENE.accuracy"
    )
    parser.add_argument("--fresh", action="store_true", help="forget the runs that are kept in DIR")
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Measure, print and write; the exit code is 0 also when the time budget ended first."""
    from mpp_taichi.accuracy.problem import pose
    from mpp_taichi.cli._refusals import require_any_backend, require_room
    from mpp_taichi.scene.load import load_scene

    spec = load_scene(arguments.scene, overrides=arguments.overrides)
    require_room(spec)
    quantity, of = asked_of(spec, arguments.of)
    try:
        problem = pose(spec, arguments.until, of)
    except ValueError as error:
        raise UsageError(f"--of {of}: {error}") from None
    wishes = _wishes(arguments, "contacts" if problem.compares_solvers else "integrators", quantity)
    require_any_backend(arguments.backends or DEFAULT_BACKENDS)
    from mpp_taichi.cli._signals import Interrupted, Interruption
    from mpp_taichi.recorders._lock import OutputLock

    folder = arguments.out or _options.OUTPUT_FOLDER / f"{_options.output_stem(spec.source)}.accuracy"
    code = 0
    with output_reserved(arguments.json), Interruption() as interruption:
        from mpp_taichi.accuracy.budget import Budget
        from mpp_taichi.accuracy.elsewhere import Elsewhere
        from mpp_taichi.accuracy.film_checks import FilmChecks
        from mpp_taichi.accuracy.findings import findings
        from mpp_taichi.accuracy.phase_studies import PhaseStudies
        from mpp_taichi.accuracy.store import Store, identity
        from mpp_taichi.accuracy.study import Study

        lock = OutputLock(folder / "accuracy.json")
        try:
            tell = (lambda _: None) if arguments.quiet else say
            budget = Budget(arguments.budget or BUDGET_SECONDS, interruption.raise_if_any)
            if (quantity, of) == (None, None):
                problem = _expected_instead(problem, budget, tell)
            store = Store(folder, identity(problem, problem.span, __version__), fresh=arguments.fresh)
            phases = PhaseStudies(tell)
            then = phases.run if len(problem.stretches) > 1 else None
            study = Study(problem, store, budget, wishes, tell, FilmChecks().run, then)
            _check_methods(wishes, list(study.methods), tell)
            if store.resumed:
                tell(f"{store.resumed} runs are known from before")
            own = spec.accuracy.error if spec.accuracy is not None else None
            try:
                with interruption.at_once():
                    study.run()
                    if arguments.backends is None:
                        target = arguments.target or own or _usual_target(study)
                        Elsewhere(study, target, arguments.precisions or PRECISIONS).run()
            except Interrupted as signal:
                study.status, code = "interrupted", signal.code
            found: dict[str, Any] = findings(study, arguments.target or own or _usual_target(study), phases.found)
            found["files"] = _write(folder, found, study, phases)
        finally:
            lock.release()
    _report(found, study, phases, arguments)
    return code


def _write(folder: Path, found: dict[str, Any], study: "Study", phases: "PhaseStudies") -> list[str]:
    """Write accuracy.json and accuracy.html."""
    from mpp_taichi.accuracy.report import page

    text = page(found, study.rows(), [phase.study.rows() for phase in phases.found])
    return write_report(folder, "accuracy", found, text)


def _report(found: dict[str, Any], study: "Study", phases: "PhaseStudies", arguments: argparse.Namespace) -> None:
    from mpp_taichi.accuracy.report import circumstances, machine
    from mpp_taichi.accuracy.table import front_lines, key, lines

    if arguments.json:
        put_json(found)
    elif not arguments.quiet:
        verdict = found["verdict"]
        fronts = {name: verdict.get(f"{name}_front", ()) for name in ("time", "evaluations")}
        table = [*lines(study.rows(), fronts, found["wanted"]), "", *(f"  {line}" for line in key(found["wanted"]))]
        put("\n".join([*table, "", *circumstances(found), machine(found)]))
        for facts, phase in zip(found["phases"], phases.found):
            put("\n".join(["", phase.told, *front_lines(phase.study.rows(), facts["verdict"]), facts["sentence"]]))
        put(f"\n{found['sentence']}")
        put(f"\nwrote {', '.join(found['files'])}")


def _expected_instead(problem: "Problem", budget: "Budget", tell: Callable[[str], None]) -> "Problem":
    """The problem with the first entry of `expect:`, where collisions leave the positions at the end no meaning."""
    from dataclasses import replace

    from mpp_taichi.accuracy.collisions import meaning_ends
    from mpp_taichi.accuracy.wanted import Wanted, first_expected

    name = first_expected(problem.spec)
    if name is None or (end := meaning_ends(problem, budget)) is None:
        return problem
    tell(f"positions mean nothing beyond t = {end:.4g}: {name} is compared, the first entry of expect:; --of names another")
    return replace(problem, wanted=Wanted.of(problem.spec, name))


def asked_of(spec: "SceneSpec", option: str | None) -> tuple[str | None, str | None]:
    """The quantity of a study, position or energy, and the quantity of `expect:` in its place, by --of or by the scene."""
    if option in OWN_QUANTITIES:
        return OWN_QUANTITIES[option], None
    if option is not None:
        return None, option
    return (None, None) if spec.accuracy is None else (spec.accuracy.quantity, spec.accuracy.of)


def _usual_target(study: "Study") -> float:
    """The target where none is given: TARGET, or for a quantity that scatters the power of ten above its bars."""
    values = study.value_reference
    if values is None or values.runs == 1:
        return TARGET
    return float(10.0 ** math.ceil(math.log10(2.0 * math.sqrt(2.0) * values.bar)))


def _wishes(arguments: argparse.Namespace, kind: str, quantity: str | None) -> "StudyWishes":
    """The methods to try: integrators, or the solvers of a scene with contacts."""
    from mpp_taichi.accuracy.study import StudyWishes
    from mpp_taichi.device.availability import BACKENDS

    allowed = {"integrators": component.names(kind), "precisions": list(PRECISIONS), "backends": list(BACKENDS)}
    for option, known in allowed.items():
        for name in getattr(arguments, option) or ():
            if _without_tree(name) not in known:
                raise UsageError(f"--{option} {name}: allowed are {', '.join(known)}")
    precisions = arguments.precisions or DEFAULT_PRECISIONS
    devices = [(backend, precision) for backend in arguments.backends or DEFAULT_BACKENDS for precision in precisions]
    small = SMALL_BUDGET_SECONDS if arguments.budget is None else None
    return StudyWishes(arguments.integrators, devices, quantity=quantity, small=small)


def _without_tree(name: str) -> str:
    """The integrator of a method, without its tree and its variant."""
    from mpp_taichi.accuracy.force_solvers import split
    from mpp_taichi.accuracy.method_variants import split_variant

    try:
        return split_variant(split(name)[0])[0]
    except ValueError as error:
        raise UsageError(f"--integrators {name}: {error}") from None


def _check_methods(wishes: "StudyWishes", suited: list[str], tell: Callable[[str], None]) -> None:
    """Print which of the requested methods the scene does not support; UsageError where none is left."""
    unsuited = [name for name in wishes.integrators or () if name not in suited]
    if not unsuited:
        return
    line = f"--integrators {','.join(unsuited)}: not for this scene, which can have {', '.join(suited)}"
    if len(unsuited) == len(wishes.integrators or ()):
        raise UsageError(line)
    tell(line)


def names(text: str) -> list[str]:
    """The names of a list `a,b,c`."""
    found = [name.strip() for name in text.split(",") if name.strip()]
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r} names nothing")
    return list(dict.fromkeys(found))


def span_of_time(text: str) -> float:
    """`90`, `60s`, `1.5min` or `1h`, in seconds."""
    number = text.strip().rstrip("abcdefghijklmnopqrstuvwxyz")
    unit = text.strip()[len(number) :] or "s"
    if unit not in UNITS:
        raise argparse.ArgumentTypeError(f"{text!r}: the unit must be one of {', '.join(UNITS)}")
    return _options.positive_number(number) * UNITS[unit]
