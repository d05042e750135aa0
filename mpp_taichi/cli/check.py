"""Check scenes: run each scene and compare its results with its own `expect:` block.

Takes files and folders; a folder means every *.yaml in it. Scenes run without pictures: a few one after the other in this
process, many at once in processes of their own.
A scene that needs an ability that the backend or the precision lacks neither passes nor fails: it is counted apart, with
the reason.

A worksheet of the course (`mpp-taichi new answers.yaml --sheet two_bodies`) is graded: a run answers each question.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import UsageError, explain_error, output_reserved, put, put_json, say
from mpp_taichi.device.thread_count import processors
from mpp_taichi.errors import MppError, SceneError, StabilityError, UnsupportedError

if TYPE_CHECKING:
    from mpp_taichi.cli._verdicts import Verdicts

NOT_HERE = "not possible here"
NOT_RUN = "-   "
FEW = 4  # scenes: so few are finished here before other processes would have started


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scenes", nargs="+", metavar="SCENE", help="scene files, or folders of them")
    parser.add_argument(
        "--jobs",
        type=_options.thread_count,
        metavar="N",
        help=f"scenes to run at once; absent: as many as there are processors where more than {FEW} are checked",
    )
    parser.add_argument("--kept-run", type=Path, help=argparse.SUPPRESS)  # of a process that another check has started
    _options.add_device(parser)
    _options.add_journal(parser, "out/check-….journal")
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Check all scenes; the exit code belongs to the first faulty scene, else is 4 when an expectation failed, else 0.

    Where the backend can run none of the scenes, the exit code says that the backend is missing.
    """
    from mpp_taichi.cli._study_journal import went_on
    from mpp_taichi.cli._verdicts import Verdicts
    from mpp_taichi.worksheets.answers import is_answers

    scenes = _scene_files(arguments.scenes)
    if sheets := [scene for scene in scenes if is_answers(scene)]:
        return _grade(sheets, scenes, arguments)
    jobs = arguments.jobs or (1 if len(scenes) <= FEW else processors())
    with output_reserved(arguments.json), Verdicts(scenes, arguments) as verdicts:
        if jobs == 1 or len(scenes) == 1:
            results = [verdicts.get(scene) or _check(scene, arguments, verdicts) for scene in scenes]
        else:
            from mpp_taichi.cli._check_in_parallel import check_at_once

            results = check_at_once(scenes, jobs, arguments, _failure, verdicts)
    run = [result["exit_code"] for result in results if result["status"] != NOT_HERE]
    broken = [code for code in run if code not in (0, StabilityError.exit_code)]
    code = broken[0] if broken else max(run, default=UnsupportedError.exit_code)
    if arguments.json:
        counts = {"passed": run.count(0), "failed": len(run) - run.count(0), "not_possible_here": len(results) - len(run)}
        told = {"scenes": results, **counts, "went_on": went_on(verdicts.journal)}
        put_json({**told, "status": "ok" if code == 0 else "failed", "exit_code": code})
    elif not arguments.quiet:
        _put_table(results)
    return code


def _scene_files(given: list[str]) -> list[Path]:
    from mpp_taichi.scene.bundled import scene_file

    found: list[Path] = []
    for text in given:
        path = scene_file(text)
        inside = sorted(path.glob("*.yaml")) if path.is_dir() else [path]
        if not inside:
            raise UsageError(f"check: {path} holds no *.yaml")
        found += inside
    return found


def _grade(sheets: list[Path], given: list[Path], arguments: argparse.Namespace) -> int:
    from mpp_taichi.cli import _grades

    if len(given) > 1:
        raise UsageError(f"check: {sheets[0]} is a worksheet, which is graded alone")
    return _grades.put_grades(sheets[0], arguments)


def _check(scene: Path, arguments: argparse.Namespace, verdicts: "Verdicts") -> dict[str, Any]:
    from mpp_taichi.cli._choose_method import settled
    from mpp_taichi.cli._signals import Interrupted
    from mpp_taichi.scene.load import load_scene

    if not arguments.quiet:
        say(f"checking {scene}")
    try:
        spec, precision, _ = settled(load_scene(scene), arguments)
        from mpp_taichi.cli._request import Request
        from mpp_taichi.cli._session import run_scene  # a scene with a fault does not wait for it

        where = {"backend": arguments.backend, "precision": precision, "plan": arguments.plan, "threads": arguments.threads}
        kept = arguments.kept_run or verdicts.run_of(scene)
        request = Request(**where, quiet=True, archive=kept is not None, archive_at=kept)
        outcome = run_scene(spec, request)
    except MppError as error:
        not_here = isinstance(error, UnsupportedError)
        if not not_here:
            explain_error(error)
        faults = list(error.faults) if isinstance(error, SceneError) else [str(error)]
        return _failure(scene, str(error), error.exit_code) | {"faults": faults} | ({"status": NOT_HERE} if not_here else {})
    if outcome.summary["status"] == "interrupted":
        raise Interrupted(outcome.exit_code - 128)
    result = outcome.as_json()
    verdicts.keep(scene, result)
    return result


def _failure(scene: Path, error: str, exit_code: int) -> dict[str, Any]:
    """The entry of a scene that gave no result."""
    return {"scene": str(scene), "status": "failed", "error": error, "faults": [error], "expect": [], "exit_code": exit_code}


def _put_table(results: list[dict[str, Any]]) -> None:
    lines = []
    for result in results:
        seconds = f"{result['wall_seconds']:.1f} s" if "wall_seconds" in result else ""
        mark = NOT_RUN if result["status"] == NOT_HERE else _mark(result["exit_code"] == 0)
        lines.append(f"{mark}  {result['scene']}  {result['status']}  {seconds}".rstrip())
        lines += [f"      {line}" for line in str(result.get("error", "")).splitlines()]
        for row in result["expect"]:
            reason = f"  ({row['reason']})" if row["reason"] else ""
            value = row.get("told", row["value"])  # a journal of an earlier version has only the number
            lines.append(
                f"      {_mark(row['passed'])}  {row.get('named') or row['label']} = {value}, expected {row['bound']}{reason}"
            )
        if not result["expect"] and "error" not in result:
            lines.append("      it expects nothing")
    passed = sum(result["exit_code"] == 0 for result in results)
    not_here = sum(result["status"] == NOT_HERE for result in results)
    others = f", {not_here} {NOT_HERE}" if not_here else ""
    put("\n".join([*lines, f"{passed} of {len(results) - not_here} scenes pass{others}"]), verdicts=True)


def _mark(passed: bool) -> str:
    return "pass" if passed else "FAIL"
