"""Replay a run from its archive: the state of any moment, bit for bit, or a film of it with another view.

ARCHIVE is the file out/SCENE.run that a long run keeps. A moment is computed again from the last record before it. Without
--at, the last record is taken. --video, --frames and --html record a film from --from to --until: its steps are computed
again from the last record before --from, and its view is that of the scene, changed by --set view.KEY=VALUE.
"""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import UsageError, output_reserved, put, put_json

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


FILMS = ("video", "frames", "html")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("archive", type=Path, metavar="ARCHIVE", help="the archive of a run, out/SCENE.run")
    parser.add_argument("--at", type=float, metavar="T", help="the simulated time of the moment")
    parser.add_argument("--snapshot", type=_options.output_path, metavar="F.npz", help="write the state")
    parser.add_argument("--still", type=_options.output_path, metavar="F.png", help="draw a picture, as the scene's view: says")
    parser.add_argument("--video", type=_options.output_path, metavar="F", help="a film: .mp4, .gif or .webp")
    parser.add_argument("--frames", type=_options.output_path, metavar="DIR", help="a film as a folder of pictures")
    parser.add_argument("--html", type=_options.output_path, metavar="F.html", help="a film as one file that a browser plays")
    parser.add_argument("--from", dest="begin", type=float, metavar="T", help="time at which the film begins; the run's start")
    parser.add_argument("--until", type=float, metavar="T", help="time at which the film ends; the run's end, or last record")
    parser.add_argument("--fps", type=_options.positive_number, metavar="N", help="frames a second; the run's when absent")
    parser.add_argument(
        "--duration", type=_options.positive_number, metavar="T", help="length of the film in seconds; its share of the run's"
    )
    parser.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help="change the view: view.camera.field_of_view=20, record.panels=none; repeatable",
    )
    parser.add_argument("--size", type=_options.picture_size, metavar="WxH", help="size of the picture in pixels")
    _options.add_renderer(parser, default=None)
    parser.add_argument("--threads", type=_options.thread_count, metavar="N", help="threads of the CPU")
    _options.add_report(parser)
    _options.add_verbose(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Record a film, or go to the moment, write the state and the picture that are asked for, and print its time and step."""
    from mpp_taichi.cli._replay_film import check_overrides
    from mpp_taichi.cli._signals import Interruption
    from mpp_taichi.simulation.resume import resume

    for name, time in (("--at", arguments.at), ("--from", arguments.begin), ("--until", arguments.until)):
        if time is not None and not math.isfinite(time):
            raise UsageError(f"replay: {name} must be a finite time, got {time}")
    check_overrides(arguments.overrides)
    if any(getattr(arguments, name) is not None for name in FILMS):
        return _film(arguments)
    if any(getattr(arguments, name) is not None for name in ("begin", "until", "fps", "duration", "renderer")):
        of_films = "--from, --until, --fps, --duration and --renderer"
        raise UsageError(f"replay: {of_films} are of a film: --video F.mp4, --frames DIR, --html F.html")
    _options.require_suffix(arguments.snapshot, (".npz",), "--snapshot")
    _options.require_suffix(arguments.still, (".png",), "--still")
    what = {name: getattr(arguments, name) for name in ("at", "threads", "overrides")} | {"path": arguments.archive}
    with Interruption() as interruption, interruption.at_once(), output_reserved(arguments.json):
        with resume(**what) as simulation:
            record = {"record_time": simulation.time, "record_step": simulation.step_count}
            if arguments.at is not None and arguments.at > simulation.time:
                simulation.run(until=arguments.at)
            found = {"archive": str(arguments.archive), "time": simulation.time, "step": simulation.step_count, **record}
            found |= {"total_energy": float(simulation.mechanics()["total_energy"]), "status": simulation.verdict.status}
            found |= {"files": _write(simulation, arguments), "exit_code": 0}
    _tell(found, arguments)
    return 0


def _film(arguments: argparse.Namespace) -> int:
    from mpp_taichi.cli._outcome import report
    from mpp_taichi.cli._replay_film import record_film

    if any(getattr(arguments, name) is not None for name in ("at", "snapshot", "still")):
        raise UsageError("replay: --at, --snapshot and --still are of one moment, and not of a film")
    with output_reserved(arguments.json):
        outcome = record_film(arguments)
    return report(outcome, arguments)


def _write(simulation: "Simulation", arguments: argparse.Namespace) -> list[str]:
    from mpp_taichi.views.picture import save_picture

    if arguments.snapshot is not None:
        simulation.checkpoint(arguments.snapshot)
    if arguments.still is not None:
        save_picture(simulation.picture(arguments.size or simulation.scene.record.size), arguments.still)
    return [str(path) for path in (arguments.snapshot, arguments.still) if path is not None]


def _tell(found: dict[str, Any], arguments: argparse.Namespace) -> None:
    if arguments.json:
        put_json(found)
        return
    if not arguments.quiet:
        put(f"t = {found['time']:.9g}, step {found['step']:,}; from the record of t = {found['record_time']:.9g}")
        for path in found["files"]:
            put(f"wrote {path}")
