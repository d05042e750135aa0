"""Record a scene as a film, or as a page that plays it in a browser, frame by frame, without a window.

The film has exactly round(FPS x T) frames, and the run is spread evenly over them: frame k shows the simulated time
k / (frames - 1) of the run. Between two steps the positions shown are x + v d, where d < dt is the time since the last step
(dense output of first order), or on the orbits of wisdom_holman; the computation itself takes the same steps as without a film.
"""

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import UsageError, output_reserved, say

if TYPE_CHECKING:
    from mpp_taichi.beside.settings import Beside
    from mpp_taichi.scene.spec import SceneSpec


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    _options.add_scene(parser)
    _options.add_member(parser)
    parser.add_argument("--video", type=_options.output_path, metavar="F", help="the film: .mp4, .gif or .webp")
    parser.add_argument("--still", type=_options.output_path, metavar="F.png", help="only the last frame, as a picture")
    parser.add_argument("--frames", type=_options.output_path, metavar="DIR", help="a folder of pictures; needs no encoder")
    parser.add_argument(
        "--html", type=_options.output_path, metavar="F.html", help="one file that a browser plays, with camera and plots"
    )
    parser.add_argument("--size", type=_options.picture_size, metavar="WxH", help="size of the picture in pixels")
    parser.add_argument("--fps", type=_options.positive_number, metavar="N", help="frames a second; the scene's when absent")
    parser.add_argument(
        "--duration", type=_options.positive_number, metavar="T", help="length of the film in seconds; the scene's when absent"
    )
    parser.add_argument(
        "--beside",
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help="two halves: the scene, and on the right the scene with this change, as in --set; also integrator=NAME, dt=, "
        "backend=, precision=, plan=, threads=; below, their distance; repeatable",
    )
    _options.add_renderer(parser)
    _options.add_length(parser)
    _options.add_device(parser)
    _options.add_tables(parser)
    parser.add_argument("--allow-inaccurate", action="store_true", help="end with code 0 even when energy was lost")
    _options.add_force(parser)
    _options.add_archive(parser)
    _options.add_report(parser)
    _options.add_verbose(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Record, and return the exit code."""
    if all(path is None for path in (arguments.video, arguments.still, arguments.frames, arguments.html)):
        raise UsageError("record: where to? --video F.mp4 (or .gif, .webp), --still F.png, --frames DIR or --html F.html")
    spec = _options.scene_of(arguments)
    fps, seconds = arguments.fps or spec.record.fps, arguments.duration or spec.record.seconds
    if fps * seconds <= 0.5:
        raise UsageError(f"record: a film of {seconds:g} s at {fps:g} frames a second has no frame")
    from mpp_taichi.cli._amounts import check_frames
    from mpp_taichi.cli._choose_method import settled
    from mpp_taichi.cli._outcome import report
    from mpp_taichi.cli._request import Request
    from mpp_taichi.cli._session import run_scene

    names = (
        "backend",
        "precision",
        "plan",
        "threads",
        "until",
        "steps",
        "video",
        "frames",
        "html",
        "still",
        "size",
        "renderer",
        "fps",
        "trajectory",
        "snapshot",
    )
    more = ("diagnostics", "inspect", "modes", "speeds", "events", "every", "quiet", "allow_inaccurate", "force")
    given = {name: getattr(arguments, name) for name in (*names, *more)}
    given |= {"archive": not arguments.no_archive, "fresh": arguments.fresh}
    request = Request(**given, film_seconds=arguments.duration)
    check_frames(spec, request)  # checked before pilot runs choose a method
    with output_reserved(arguments.json):
        spec, arguments.precision, choice = settled(spec, arguments)
        beside = _right_half(spec, arguments, chosen=bool(choice))
        outcome = run_scene(spec, replace(request, precision=arguments.precision, beside=beside))
        outcome.summary |= choice
    return report(outcome, arguments)


def _right_half(spec: "SceneSpec", arguments: argparse.Namespace, *, chosen: bool) -> "Beside | None":
    """The right half of `--beside`, or else of the scene; it begins with the method that was chosen for the left half."""
    from mpp_taichi.scene.right_half import as_texts

    said = arguments.beside or as_texts(spec.record.beside)
    if arguments.html is not None and arguments.beside:
        raise UsageError(f"record --beside: --html {arguments.html} holds one run; --video, --still and --frames show two")
    if arguments.html is not None and said and not arguments.quiet:
        say(f"note: --html {arguments.html} holds one run: record.beside is left out")
    if arguments.html is not None or not said:
        return None
    from mpp_taichi.beside.settings import beside

    source, overrides = (spec, []) if chosen else (arguments.scene, arguments.overrides)
    return beside(spec, said, source, overrides)
