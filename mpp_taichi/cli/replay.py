"""Replay a run from its archive: the state of any moment, bit for bit, without a new run.

ARCHIVE is the file out/SCENE.run that a long run keeps. The moment is computed anew from the nearest record before it. Without
--at, the last record is taken.
"""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import UsageError, output_reserved, put, put_json

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("archive", type=Path, metavar="ARCHIVE", help="the archive of a run, out/SCENE.run")
    parser.add_argument("--at", type=float, metavar="T", help="the simulated time of the moment")
    parser.add_argument("--snapshot", type=_options.output_path, metavar="F.npz", help="write the state")
    parser.add_argument("--still", type=_options.output_path, metavar="F.png", help="draw a picture, as the scene's view: says")
    parser.add_argument("--size", type=_options.picture_size, metavar="WxH", help="size of the picture in pixels")
    parser.add_argument("--threads", type=_options.thread_count, metavar="N", help="threads of the CPU")
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Go to the moment, write the state and the picture that are asked for, and print the time and the step of the moment."""
    from mpp_taichi.cli._signals import Interruption
    from mpp_taichi.simulation.resume import resume

    if arguments.at is not None and not math.isfinite(arguments.at):
        raise UsageError(f"replay: --at must be a finite time, got {arguments.at}")
    _options.require_suffix(arguments.snapshot, (".npz",), "--snapshot")
    _options.require_suffix(arguments.still, (".png",), "--still")
    with Interruption() as interruption, interruption.at_once(), output_reserved(arguments.json):
        with resume(arguments.archive, at=arguments.at, threads=arguments.threads) as simulation:
            record = {"record_time": simulation.time, "record_step": simulation.step_count}
            if arguments.at is not None and arguments.at > simulation.time:
                simulation.run(until=arguments.at)
            found = {"archive": str(arguments.archive), "time": simulation.time, "step": simulation.step_count, **record}
            found |= {"total_energy": float(simulation.mechanics()["total_energy"]), "status": simulation.verdict.status}
            found |= {"files": _write(simulation, arguments), "exit_code": 0}
    _tell(found, arguments)
    return 0


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
