"""The page of `record --html`: a header in JSON, the frames as one compressed block, and the player, filled into a template."""

import base64
import json
import math
import re
import zlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from html import escape
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.recorders._column_code import EncodedColumn, encode, grid_step, stacked
from mpp_taichi.recorders._page_paths import FinerPaths, PathPoints, finer_paths
from mpp_taichi.recorders.motion import MOMENTS
from mpp_taichi.scene.human_units import TimeScale, length_units, symbol
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.version import __version__
from mpp_taichi.views._base import WALL_COLOR, WALL_WIDTH, Frame
from mpp_taichi.views.camera import MARGIN, Camera
from mpp_taichi.views.motion_places import chooses_its_place
from mpp_taichi.views.wall_outline import outline_of

TEMPLATE_FOLDER = Path(__file__).with_name("page")
SCRIPTS = (
    "data.js",
    "camera.js",
    "shaders.js",
    "trails.js",
    "drawing.js",
    "overlay.js",
    "plot.js",
    "inspector.js",
    "player.js",
)
POSITION_BYTES = (2, 3)  # for each coordinate of a frame: the fewest bytes that keep the error within LARGEST_SHIFT
LARGEST_SHIFT = 0.25  # pixels of the first view between a particle and its true place
MOST_TRAIL_SEGMENTS = 200_000  # a browser draws this number thirty times a second
TRAIL_SHIFT = 0.5  # pixels of the first view between a trail and the path
COMPRESSION_LEVEL = 6
SERIES = (
    ("relative_energy_error", "relative energy error", ""),
    ("total_energy", "total energy", "energy"),
    ("kinetic_energy", "kinetic energy", "energy"),
    ("potential_energy", "potential energy", "energy"),
)
"""Columns of the table of samples that can be plotted: key, name, and the group of columns that share axes."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded run: its frames, the names of its particles, and its samples of energies.

    `speeds` has one array for each frame, or none; `size` is the size in pixels of the picture of the first view; `legend`
    explains the colours in words, and `paths` are as in `finer_paths`.
    """

    spec: SceneSpec
    frames: Sequence[Frame]
    speeds: Sequence[np.ndarray]
    names: Sequence[str]
    rows: Sequence[dict[str, Any]]
    size: tuple[int, int]
    fps: float
    legend: Sequence[str] = ()
    paths: Sequence[PathPoints | None] = ()


def page(recording: Recording) -> str:
    """The whole page, which loads no other file."""
    spec, frames = recording.spec, recording.frames
    first = frames[0] if frames[0].motion is not None else replace(frames[0], motion=_motion(spec, frames))
    camera = Camera(spec.view.camera, first, aspect=recording.size[0] / recording.size[1], dimensions=spec.dimensions)
    positions, shift = _position_columns(frames, camera, recording.size)
    columns = [*positions, *_other_columns(frames, recording.speeds)]
    epochs = [list(same) for _, same in groupby(range(len(frames)), key=_spring_key(frames))]
    colors = [encode("spring_color", stacked([frames[k].spring_color for k in epoch]), 1) for epoch in epochs]
    springs = [
        {"first": epoch[0], "count": len(frames[epoch[0]].between), "frames": len(epoch), "color": color.description()}
        for epoch, color in zip(epochs, colors, strict=True)
    ]
    links = [np.asarray(frames[epoch[0]].between, dtype="<i4").tobytes() for epoch in epochs]
    trails = min(spec.view.trails, len(frames) - 1, MOST_TRAIL_SEGMENTS // max(1, len(frames[0].position)))
    finer = _finer_paths(recording, camera, max(column.byte_count for column in positions)) if trails > 0 else None
    in_order = [*columns, *(finer.columns if finer is not None else ())]
    block = b"".join([*(column.packed() for column in in_order), *links, *(color.packed() for color in colors)])
    header = {
        "title": spec.title,
        "scene": Path(spec.source).name,
        "units": spec.units,
        "clock": asdict(TimeScale.of(spec.units, frames[-1].time)),
        "fps": recording.fps,
        "times": [frame.time for frame in frames],
        "captions": [frame.extra for frame in frames] if any(frame.extra for frame in frames) else None,
        "dimmed": [frame.dimmed for frame in frames] if any(frame.dimmed for frame in frames) else None,
        "names": list(recording.names) if any(recording.names) else None,
        "camera": _camera(camera, recording.size),
        "view": _view(spec, trails) | {"period": outline_of(spec, frames[0].position).repeating.period},
        "columns": [column.description() for column in columns],
        "path": None if finer is None else finer.description(),
        "springs": springs,
        "series": _series(recording.rows),
        "notes": _notes(recording, positions, shift, trails),
    }
    parts = {
        "TITLE": escape(spec.title or Path(spec.source).stem or "Scene"),
        "STYLE": _template("style.css"),
        "HEADER": json.dumps(header, ensure_ascii=False, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "BLOCK": base64.b64encode(zlib.compress(block, COMPRESSION_LEVEL)).decode("ascii"),
        "SCRIPT": "\n".join(_template(name) for name in SCRIPTS),
    }
    return re.sub(r"@@([A-Z]+)@@", lambda match: parts[match[1]], _template("page.html"))


def _motion(spec: SceneSpec, frames: Sequence[Frame]) -> np.ndarray | None:
    """The places of some of the frames, for a camera without a position."""
    if not chooses_its_place(spec):
        return None
    alike = [frame for frame in frames[:: max(1, len(frames) // MOMENTS)] if len(frame.position) == len(frames[0].position)]
    return np.concatenate([np.concatenate([frame.position, np.asarray(frame.radius)[:, None]], axis=1) for frame in alike])


def _template(name: str) -> str:
    return (TEMPLATE_FOLDER / name).read_text(encoding="utf-8")


def _position_columns(frames: Sequence[Frame], camera: Camera, size: tuple[int, int]) -> tuple[list[EncodedColumn], float]:
    """The coordinates, and the largest shift of a particle by their rounding, in pixels of the first view."""

    def axis(number: int) -> np.ndarray:
        return np.stack([frame.position[:, number] for frame in frames])

    for byte_count in POSITION_BYTES:
        reach = np.linalg.norm([grid_step(axis(number), byte_count) / 2.0 for number in range(3)], axis=0)
        shift = max(_largest_shift(frame.position, reach, camera, size) for frame in frames)
        if shift <= LARGEST_SHIFT:
            break
    return [encode(name, axis(number), byte_count) for number, name in enumerate("xyz")], shift


def _largest_shift(position: np.ndarray, reach: np.ndarray, camera: Camera, size: tuple[int, int]) -> float:
    """The largest shift of a visible particle in the picture [pixels] where its position has an error up to `reach` [length].

    On the screen it is at f (x, y)/z; a change δ of (x, y, z) moves it by f |δ| √(1 + (x² + y²)/z²)/z at most, the largest
    singular value of the derivative, where z is reduced by |δ|, so that the bound holds along the whole shift.
    """
    width, height = size
    right, up, depth = camera.view(position).T
    rows = height / camera.visible_height  # pixels per length at the target
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        if camera.orthographic:
            scale, slant = np.full_like(depth, rows), np.ones_like(depth)
        else:
            near = depth - reach
            scale = np.where(near > 0.0, rows * camera.distance / near, np.inf)
            slant = np.sqrt(1.0 + (right**2 + up**2) / near**2)
        seen = (depth > 0.0) & (np.abs(right) * scale < width / 2.0) & (np.abs(up) * scale < height / 2.0)
        shifts = reach * scale * slant
    return float(shifts[seen].max(initial=0.0))


def _other_columns(frames: Sequence[Frame], speeds: Sequence[np.ndarray]) -> list[EncodedColumn]:
    columns = [
        encode("radius", stacked([frame.radius for frame in frames]), 2),
        encode("color", stacked([frame.color for frame in frames]), 1),
        encode("walls", stacked([frame.outline for frame in frames]), 2),
    ]
    if len(speeds) == len(frames):
        columns.append(encode("speed", stacked(speeds), 2))
    return columns


def _finer_paths(recording: Recording, camera: Camera, byte_count: int) -> FinerPaths | None:
    tolerance = TRAIL_SHIFT * camera.visible_height / recording.size[1]
    return finer_paths(recording.frames, recording.paths, tolerance, max(byte_count, POSITION_BYTES[0]))


def _spring_key(frames: Sequence[Frame]) -> Callable[[int], int]:
    """A number for the springs of a frame, equal for successive frames with the same springs: a timeline may change them."""
    keys, number = [0], 0
    for before, after in zip(frames, frames[1:], strict=False):
        number += not np.array_equal(before.between, after.between)
        keys.append(number)
    return keys.__getitem__


def _camera(camera: Camera, size: tuple[int, int]) -> dict[str, Any]:
    return {
        "target": camera.target.tolist(),
        "backward": camera.backward.tolist(),
        "axis": camera.axis.tolist(),
        "distance": camera.distance,
        "height": camera.height,
        "fieldOfView": camera.field_of_view,
        "orthographic": camera.orthographic,
        "aspect": size[0] / size[1],
        "margin": MARGIN,
    }


def _view(spec: SceneSpec, trails: int) -> dict[str, Any]:
    view = spec.view
    return {
        "background": view.background,
        "radiusScale": view.radius_scale,
        "minimumPixels": view.minimum_pixels,
        "springWidth": view.spring_width,
        "trails": max(0, trails),
        "collides": bool(spec.contacts or spec.walls),
        "caption": view.caption,
        "labels": view.labels or None,
        "scaleBar": length_units(spec.units) if view.scale_bar else None,
        "wallColor": WALL_COLOR,
        "wallWidth": WALL_WIDTH,
    }


def _series(rows: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """Energies at the times of the samples; their error only where every force conserves the energy."""
    if len(rows) < 2:
        return None
    keys = [entry for entry in SERIES if entry[0] != "relative_energy_error" or all(row["conserves_energy"] for row in rows)]
    curves = [{"label": label, "group": group, "values": [_finite(row[key]) for row in rows]} for key, label, group in keys]
    return {"times": [row["time"] for row in rows], "curves": curves}


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _notes(recording: Recording, positions: Sequence[EncodedColumn], shift: float, trails: int) -> list[str]:
    """Notes for the reader about the numbers of the page."""
    spec, frames = recording.spec, recording.frames
    width, height = recording.size
    reach = float(np.linalg.norm([column.step / 2.0 for column in positions], axis=0).max(initial=0.0))
    unit = f" {symbol(spec.units['length'])}" if spec.units else ""
    bits = 8 * max(column.byte_count for column in positions)
    notes = [
        f"{len(frames):,} frames of {len(frames[0].position):,} particles, {recording.fps:g} a second, from "
        f"{Path(spec.source).name}; integrator {spec.integrator.name}. Made by mpp_taichi {__version__}.",
        f"Positions are on grids of {bits} bits, one for each particle and axis. They are off by {reach:.1e}{unit} at most, "
        f"in the first view at {width} × {height} by {shift:.2g} pixels."
        if bits
        else "Nothing moves.",
        "Energies are from the run itself, at the times of its own samples, joined by straight lines.",
    ]
    notes += [f"Legend: {line}." for line in recording.legend]
    if any(body.distance_scale != 1.0 for body in spec.view.bodies.values()):
        notes.append("Bodies with a distance_scale are drawn farther out than they are; plots have the places drawn.")
    if trails < min(spec.view.trails, len(frames) - 1):
        notes.append(f"Trails show {trails:,} frames in place of {spec.view.trails:,}, as many as a browser draws in time.")
    return notes
