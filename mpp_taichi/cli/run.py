"""Run a scene: in a window where there is a display, else into a film. Without a scene, a window lists the scenes.

With --headless nothing is shown, and only the requested files are written. With --video the run becomes a film. Where no window
can open, the run becomes the film out/SCENE.mp4, and one line says why. A window stays open until it is closed; at the end of
the scene's duration it pauses.
"""

import argparse
import os
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import UsageError, output_reserved, put_json, say
from mpp_taichi.views.looks import LOOKS, MOST_PARTICLES

if TYPE_CHECKING:
    from mpp_taichi.cli._outcome import Outcome
    from mpp_taichi.cli._request import Request
    from mpp_taichi.scene.spec import SceneSpec


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    _options.add_scene(parser, or_list=True)
    _options.add_member(parser)
    parser.add_argument("--headless", action="store_true", help="no window, and no film unless --video says so")
    parser.add_argument("--video", type=_options.output_path, metavar="F", help="film of the run: .mp4, .gif or .webp")
    parser.add_argument("--html", type=_options.output_path, metavar="F.html", help="page of the run, for a browser; no window")
    parser.add_argument(
        "--look",
        choices=LOOKS,
        help="of the window: film, as a film shows the scene; plain, spheres and lines drawn by GGUI; auto: film up to "
        f"{MOST_PARTICLES:,} particles",
    )
    parser.add_argument(
        "--fresh-window",
        action="store_true",
        help="neither use nor keep the settings of the window of the last run, as with "
        f"{_options.WINDOW_VARIABLE}={_options.FRESH} in the environment",
    )
    _options.add_length(parser)
    _options.add_device(parser)
    _options.add_tables(parser)
    parser.add_argument("--dry-run", action="store_true", help="print the plan of the run, and start no device")
    parser.add_argument("--allow-inaccurate", action="store_true", help="end with code 0 even when energy was lost")
    parser.add_argument(
        "--energy-balance",
        action="store_true",
        help="account for dissipated energy, work and the energy that the method loses by itself",
    )
    parser.add_argument(
        "--log",
        type=_options.output_path,
        metavar="F.yaml",
        help="the changes by sliders, as a scene file that repeats the motion bit for bit",
    )
    _options.add_force(parser)
    parser.add_argument(
        "--rewind",
        nargs="?",
        const="",
        metavar="F",
        help="go on from the last good state of a run that blew up or was interrupted, with a stable step: that of "
        "out/SCENE.run, or else the newest of out/SCENE.crash.npz and out/SCENE.interrupted.npz, when no file is named",
    )
    _options.add_archive(parser)
    _options.add_report(parser)
    _options.add_verbose(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Run, and return the exit code."""
    if arguments.scene is None:
        return _begin_with_a_list(arguments)
    spec = _options.scene_of(arguments)
    if arguments.dry_run:
        from mpp_taichi.cli._dry_run import dry_run

        return dry_run(spec, arguments)
    from mpp_taichi.cli._choose_method import settled
    from mpp_taichi.cli._kept_settings import kept_settings
    from mpp_taichi.cli._outcome import report
    from mpp_taichi.cli._session import run_scene

    with output_reserved(arguments.json):
        spec, arguments.precision, choice = settled(spec, arguments)
        request = request_of(arguments, spec)
        with kept_settings(fresh=arguments.fresh_window or not request.window) as settings:
            request = replace(request, settings=settings)
            outcome = run_scene(spec, request)
            outcome.summary |= choice
            outcome, earlier = _all_scenes(outcome, request, arguments)
    return report(outcome, arguments, before=earlier)


def _all_scenes(outcome: "Outcome", request: "Request", arguments: argparse.Namespace) -> "tuple[Outcome, list[Outcome]]":
    """Run the scenes that are opened in the window one after the other; the outcomes of the last scene, and of those before."""
    from mpp_taichi.cli._outcome import tell
    from mpp_taichi.cli._session import run_stage

    earlier: list[Outcome] = []
    while outcome.next is not None:
        earlier.append(outcome)
        if not arguments.quiet:
            tell(outcome, arguments)
        outcome = run_stage(outcome.next, request)
    return outcome, earlier


def _begin_with_a_list(arguments: argparse.Namespace) -> int:
    """Open a window without a scene."""
    from mpp_taichi.cli._empty_window import first_stage, request_without_scene, require_no_more
    from mpp_taichi.cli._kept_settings import kept_settings
    from mpp_taichi.cli._outcome import report

    require_no_more(arguments, "")
    require_no_more(arguments, no_window())
    with output_reserved(arguments.json), kept_settings(fresh=arguments.fresh_window) as settings:
        request = replace(request_without_scene(arguments), settings=settings)
        stage = first_stage(request)
        if stage is not None:
            from mpp_taichi.cli._session import run_stage

            outcome, earlier = _all_scenes(run_stage(stage, request), request, arguments)
    if stage is not None:
        return report(outcome, arguments, before=earlier)
    if arguments.json:
        put_json({"status": "ok", "exit_code": 0})
    return 0


def request_of(arguments: argparse.Namespace, spec: "SceneSpec") -> "Request":
    """The request of the options, with a window or a film where no output is asked for."""
    from mpp_taichi.cli._request import Request

    names = ("backend", "precision", "plan", "threads", "until", "steps", "video", "html", "trajectory", "snapshot")
    more = (
        "diagnostics",
        "inspect",
        "modes",
        "speeds",
        "events",
        "log",
        "every",
        "quiet",
        "allow_inaccurate",
        "energy_balance",
        "force",
        "look",
    )
    given = {name: getattr(arguments, name) for name in (*names, *more)}
    given |= {"archive": not arguments.no_archive, "fresh": arguments.fresh}
    if arguments.rewind is not None:
        from mpp_taichi.cli._rewind import Rewind

        given["rewind"] = Rewind.of(spec, arguments.rewind, arguments.overrides, fresh=arguments.fresh)
    if arguments.headless or arguments.video is not None or arguments.html is not None:
        return Request(**given)
    problem = no_window()
    if not problem:
        return Request(**given, window=True)
    film = _options.OUTPUT_FOLDER / f"{_options.output_stem(spec.source)}.mp4"
    if spec.run.duration is None and spec.run.steps is None and arguments.until is None and arguments.steps is None:
        raise UsageError(f"{problem}, and a film needs an end: --until T or --steps N")
    say(f"{problem}: making a film instead, {film}")
    return Request(**{**given, "video": film})


def no_window() -> str:
    """The reason why no window can be opened here; empty where a window can be opened."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "there is no display"
    from mpp_taichi.device.backends import import_taichi

    import_taichi()
    from mpp_taichi.views.ggui_probe import probe

    return probe(shown=True)
