"""Amounts: the frames, pixels and samples asked for, and the memory and disk that they need, checked before a run."""

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from mpp_taichi.errors import CapacityError
from mpp_taichi.recorders.trajectory import BYTES_PER_PARTICLE
from mpp_taichi.scene.available_memory import available_bytes
from mpp_taichi.scene.estimate import estimate
from mpp_taichi.scene.spec import SceneSpec

if TYPE_CHECKING:
    from mpp_taichi.cli._goal import Goal
    from mpp_taichi.cli._request import Request

MOST_FRAMES = 10**6  # names of pictures in a folder have six digits; as a film it lasts nine hours at 30 frames a second
BYTES_PER_PIXEL = 120  # measured: memory that drawing and encoding take, from 640 x 360 to 2560 x 1440 pixels
LEAST_BYTES_PER_PIXEL = 0.0005  # on disk: a twelfth of the size of a film of two bodies on black in H.264
BYTES_PER_SAMPLE = 1000  # of memory: a row of the table of energies


def check_amounts(spec: SceneSpec, request: "Request", goal: "Goal") -> None:
    """Refuse a run whose output this machine cannot make or hold.

    Raises:
        CapacityError: too many frames, too large a picture, or too many samples.
    """
    check_frames(spec, request)
    if (every := request.every or spec.run.every) is not None and (steps := goal.step_count(spec)) is not None:
        _check_samples(spec, request, steps // every + 1)


def check_frames(spec: SceneSpec, request: "Request") -> None:
    """Refuse, by CapacityError, a film of too many frames, or of frames for which memory or disk are too small."""
    if not request.films:
        return
    fps, seconds = request.fps or spec.record.fps, request.film_seconds or spec.record.seconds
    width, height = request.size or spec.record.size
    frames = fps * seconds
    if frames > MOST_FRAMES + 0.5:
        raise CapacityError(
            f"{spec.source}: a film of {seconds:g} s at {fps:g} frames a second has {_count(frames)} frames, allowed: "
            f"{MOST_FRAMES:,}; take fewer by --fps or --duration, or by record.fps or record.seconds in the scene"
        )
    pictures = [path for path in (request.video, request.frames, request.still) if path is not None]
    if not pictures:
        return
    size = f"{spec.source}: {_count(round(frames))} frames of {width}x{height} pixels take"
    smaller = "take a smaller --size, or record.size in the scene"
    _check_memory(f"{size} about", BYTES_PER_PIXEL * width * height, smaller)
    for path in (path for path in (request.video, request.frames) if path is not None):
        _check_disk(f"{size} about", LEAST_BYTES_PER_PIXEL * width * height * frames, path, f"{smaller}, or fewer frames")


def _check_samples(spec: SceneSpec, request: "Request", samples: int) -> None:
    """Samples of the tables, which are kept in memory, and frames of the trajectory, which go to the disk."""
    what = f"{spec.source}: {samples:,} samples take at least"
    rarer = "take fewer by --every, or by run.every in the scene"
    _check_memory(what, BYTES_PER_SAMPLE * samples, rarer)
    if request.trajectory is not None:
        _check_disk(what, BYTES_PER_PARTICLE * estimate(spec).particle_count * samples, request.trajectory, rarer)


def _check_memory(what: str, needed: float, advice: str) -> None:
    free = available_bytes()
    if free is not None and needed > free:
        raise CapacityError(
            f"{what} {_size(needed)} of memory, allowed: the {_size(free)} that are available to this process; {advice}"
        )


def _check_disk(what: str, needed: float, path: Path, advice: str) -> None:
    folder = next(each for each in (Path(os.path.abspath(path)), *Path(os.path.abspath(path)).parents) if each.is_dir())
    try:
        free = shutil.disk_usage(folder).free
    except OSError:
        return  # a disk that does not answer is reported where the file is opened
    if needed > free:
        raise CapacityError(f"{what} {_size(needed)} on disk, allowed: the {_size(free)} that are free for {path}; {advice}")


def _count(number: float) -> str:
    return f"{number:,.0f}" if number < 1e15 else f"{number:.3g}"


def _size(number: float) -> str:
    return f"{number / 2**30:.3g} GiB"
