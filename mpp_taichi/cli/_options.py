"""Options that several verbs share, and the checks of their values."""

import argparse
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._terminal import UsageError
from mpp_taichi.device.thread_count import allowed_threads, most_threads
from mpp_taichi.precision import PRECISIONS
from mpp_taichi.views.numbered import OUTPUT_FOLDER
from mpp_taichi.views.renderers import RENDERERS

if TYPE_CHECKING:
    from mpp_taichi.scene.spec import SceneSpec

LARGEST_SIDE = 16384  # pixels
LONGEST_NAME = 230  # bytes: 255 on every common file system, less the room for `.part` and the like
WINDOW_VARIABLE = "MPP_TAICHI_WINDOW"
FRESH = "fresh"
"""Value of the variable with which the settings of the window are neither read nor written."""


def add_scene(parser: argparse.ArgumentParser, *, or_list: bool = False) -> None:
    """SCENE and --set; with `or_list` the scene may be absent."""
    told = "a scene file (YAML), or the name of a scene of the program"
    more: dict[str, Any] = {"nargs": "?"} if or_list else {}
    told += "; absent: a window with a list of scenes" if or_list else ""
    parser.add_argument("scene", metavar="SCENE", help=told, **more)
    parser.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help="change a value of the scene; repeatable",
    )


def scene_of(arguments: argparse.Namespace) -> "SceneSpec":
    """The scene of `add_scene`; with --until, a method that chooses its own steps needs neither `dt` nor `run.duration`."""
    from dataclasses import replace

    from mpp_taichi.scene.contacts import LOOKS
    from mpp_taichi.scene.load import load_scene

    interval = None if arguments.until is None else arguments.until / LOOKS
    if getattr(arguments, "member", None) is not None or is_sweep(arguments.scene):
        return _member_of(arguments)
    return replace(load_scene(arguments.scene, overrides=arguments.overrides, interval=interval), leaves_interval_open=False)


def add_member(parser: argparse.ArgumentParser) -> None:
    """--member."""
    parser.add_argument(
        "--member", type=whole_number, metavar="N", help="of a sweep, whose folder is given in place of a scene"
    )


def is_sweep(path: str) -> bool:
    """Whether a path is the folder of a sweep."""
    return os.path.isfile(os.path.join(path, "sweep.json"))


def _member_of(arguments: argparse.Namespace) -> "SceneSpec":
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.sweep.store import opened

    if not is_sweep(arguments.scene):
        told = f"--member {arguments.member}: {arguments.scene} is no folder of a sweep"
        raise UsageError(f"{told}; `mpp-taichi sweep SCENE` makes such a folder")
    if getattr(arguments, "member", None) is None:
        raise UsageError(f"{arguments.scene} is a sweep; --member N says which of its members")
    return load_scene(opened(Path(arguments.scene)).member(arguments.member), overrides=arguments.overrides)


def add_journal(parser: argparse.ArgumentParser, where: str) -> None:
    """--fresh, --no-archive, of a study whose journal is at `where`."""
    parser.add_argument("--fresh", action="store_true", help=f"begin anew, where {where} holds a study that was cut off")
    parser.add_argument("--no-archive", action="store_true", help=f"keep no {where} from which the same command goes on")


def add_device(parser: argparse.ArgumentParser) -> None:
    """--backend, --precision, --plan, --threads."""
    group = parser.add_argument_group("where and how")
    group.add_argument(
        "--backend", default="auto", choices=("auto", "cpu", "cuda", "vulkan", "metal"), help="device that computes"
    )
    group.add_argument("--precision", choices=PRECISIONS, help="f64 on the CPU and f32 elsewhere when absent")
    group.add_argument(
        "--plan", default="auto", choices=("auto", "serial", "parallel"), help="plan by which steps are launched"
    )
    group.add_argument(
        "--threads", type=thread_count, metavar="N", help="CPU threads; when absent, one on each logical processor"
    )


def add_renderer(parser: argparse.ArgumentParser, *, default: str | None = RENDERERS[0]) -> None:
    """--renderer."""
    told = "renderer of pictures: the program's own renderer, or GGUI of Taichi, which needs a driver of Vulkan and no display"
    parser.add_argument("--renderer", default=default, choices=RENDERERS, help=told)


def add_force(parser: argparse.ArgumentParser) -> None:
    """--force."""
    parser.add_argument("--force", action="store_true", help="run a step that is beyond what the springs allow")


def add_length(parser: argparse.ArgumentParser) -> None:
    """--until, --steps."""
    group = parser.add_argument_group("how long").add_mutually_exclusive_group()
    group.add_argument(
        "--until", type=positive_number, metavar="T", help="simulated time to reach; the scene's own end when absent"
    )
    group.add_argument("--steps", type=whole_number, metavar="N", help="steps to do")


def add_tables(parser: argparse.ArgumentParser) -> None:
    """--trajectory, --snapshot, --diagnostics, --inspect, --modes, --speeds, --events, --every."""
    group = parser.add_argument_group("files to write")
    group.add_argument("--trajectory", type=output_path, metavar="F", help="positions along the run: .npz, .xyz or .extxyz")
    group.add_argument("--snapshot", type=output_path, metavar="F.npz", help="file of the final state")
    group.add_argument("--diagnostics", type=output_path, metavar="F", help="table of energies and momenta: .csv or .npz")
    group.add_argument(
        "--inspect",
        type=output_path,
        action="append",
        default=[],
        metavar="F",
        help="file of the panels of inspect:, .csv, .svg or .png; repeatable",
    )
    group.add_argument(
        "--modes", type=output_path, metavar="F", help="amplitudes of the springs' modes: .png, .svg, .pdf, .csv or .npz"
    )
    group.add_argument(
        "--speeds", type=output_path, metavar="F", help="histogram of speeds beside theory: .png, .svg, .pdf, .csv or .npz"
    )
    group.add_argument(
        "--events",
        type=output_path,
        metavar="F",
        help="collisions, of event_driven or merging; or springs that broke: .csv or .npz",
    )
    group.add_argument(
        "--every", type=positive_integer, metavar="N", help="steps between two samples; about 200 samples when absent"
    )


def add_archive(parser: argparse.ArgumentParser) -> None:
    """--fresh, --no-archive."""
    parser.add_argument("--fresh", action="store_true", help="begin anew, where out/SCENE.run holds a run that was cut off")
    parser.add_argument("--no-archive", action="store_true", help="keep no out/SCENE.run from which the same command goes on")


def add_report(parser: argparse.ArgumentParser) -> None:
    """--json, --quiet."""
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    parser.add_argument("--quiet", "-q", action="store_true", help="no progress and no summary")


def add_verbose(parser: argparse.ArgumentParser) -> None:
    """--verbose, for verbs that end with a closing summary."""
    parser.add_argument(
        "--verbose", "-v", action="store_true", help="in the summary also the method, the device, the plan, rates and times"
    )


def positive_number(text: str) -> float:
    """A finite number above zero."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text} must be finite and above 0")
    return value


def whole_number(text: str) -> int:
    """A whole number from zero on; 1e6 is allowed."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
    if not (0.0 <= value <= 2.0**53 and value == math.floor(value)):
        raise argparse.ArgumentTypeError(f"{text} must be a whole number from 0 to 2^53")
    return int(value)


def positive_integer(text: str) -> int:
    """A whole number from one on."""
    value = whole_number(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} must be at least 1")
    return value


def thread_count(text: str) -> int:
    """A number of threads or processes, at most as many as this machine allows."""
    try:
        value = whole_number(text)
    except argparse.ArgumentTypeError:
        value = 0
    if not 1 <= value <= most_threads():
        raise argparse.ArgumentTypeError(f"{text!r} must be {allowed_threads()}")
    return value


def picture_size(text: str) -> tuple[int, int]:
    """`1280x720`."""
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isascii() and width.isdigit() and height.isascii() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} must be WIDTHxHEIGHT, as 1280x720")
    size = int(width), int(height)
    if not all(16 <= side <= LARGEST_SIDE for side in size):
        raise argparse.ArgumentTypeError(f"{text}: sides must be from 16 to {LARGEST_SIDE} pixels")
    return size


def output_path(text: str) -> Path:
    """A file to write: no address of a network, no control characters."""
    shown = text.encode(errors="replace").decode()  # without bytes that are no letters here
    if not shown.isprintable() or not text.strip():
        raise argparse.ArgumentTypeError(f"{text!r} is no name of a file")
    if any(len(os.fsencode(part)) > LONGEST_NAME for part in Path(text).parts):
        raise argparse.ArgumentTypeError(f"{text[:40]!r}… is longer than the {LONGEST_NAME} bytes that a name may have")
    if "://" in text:
        raise argparse.ArgumentTypeError(f"{text!r} is an address; files are written to this machine only")
    return Path(text)


def require_suffix(path: Path | None, allowed: tuple[str, ...], option: str) -> None:
    """Refuse a file whose suffix names another format.

    Raises:
        UsageError: the suffix is not allowed.
    """
    if path is not None and path.suffix.lower() not in allowed:
        raise UsageError(f"{option} {path}: the suffix must be one of {', '.join(allowed)}")


def archive_path(source: str) -> Path:
    """Where the archive of a scene is kept."""
    return OUTPUT_FOLDER / f"{output_stem(source)}.run"


def output_stem(source: str) -> str:
    """The beginning of the names of a scene's output files."""
    return Path(source).stem or "scene"
