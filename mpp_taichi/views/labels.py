"""Names beside bodies: which of them are shown, and where. NumPy and the font only."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from PIL import Image

from mpp_taichi.plots.lettering import lettering
from mpp_taichi.scene.view_spec import ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import Color, write_outlined

SIZE_SHARE = 0.8  # height of the letters, in heights of a line of the caption
LEAST_SIZE = 9  # pixels
GAP = 0.3  # between a body and its name, in heights of the letters
TALL = 1.25  # height of a name with the room around it, in heights of the letters
OUTLINE = 1 / 9  # width of the outline, in heights of the letters
NEAREST = 1e-3  # camera distances; bodies nearer to the eye have no name
MOST = 300  # names in a picture, of the nearest bodies
Box = tuple[float, float, float, float]
Disc = tuple[float, float, float, float]
"""Column, row and radius in pixels, and the depth [length]."""


@dataclass(frozen=True)
class NameTag:
    """A name in a picture: the left end and the middle of its line, and its box: left, top, right, bottom [pixels]."""

    text: str
    left: float
    middle: float
    box: Box


def name_tags(
    frame: Frame, view: ViewSpec, camera: Camera, size: tuple[int, int], letters: int, shift: tuple[float, float] = (0.0, 0.0)
) -> list[NameTag]:
    """The names to draw into a picture of (width, height) pixels; `shift` moves it right and up, in halves of its height.

    A name stands to the right of its body, or to the left where the picture ends. It is left out behind the camera, outside
    of the picture, where a nearer body covers the whole body, and where the name of a nearer body stands already.
    """
    if not view.labels:
        return []
    width, height = size
    tags: list[NameTag] = []
    found = list(_named(frame, view))
    if not found:
        return []
    place = np.array([each[1] for each in found]).reshape(-1, 3)
    radius = np.array([each[2] for each in found])
    column, row, disc, depth = _on_screen(place, radius, view, camera, size, shift)
    with np.errstate(invalid="ignore"):
        inside = (0.0 <= column) & (column < width) & (0.0 <= row) & (row < height)
        shown = np.flatnonzero(inside & (depth > NEAREST * camera.distance))
    position, radii = np.asarray(frame.position, dtype=float), np.asarray(frame.radius, dtype=float)
    others = _on_screen(position, radii, view, camera, size, shift)
    for n in shown[np.argsort(depth[shown], kind="stable")][:MOST]:
        if _is_covered((column[n], row[n], disc[n], depth[n]), others):
            continue
        text = found[n][0]
        wide, high = lettering(letters).width(text), TALL * letters
        left = column[n] + disc[n] + GAP * letters
        if left + wide > width:
            left = column[n] - disc[n] - GAP * letters - wide
        tag = NameTag(text, left, row[n], (left, row[n] - high / 2.0, left + wide, row[n] + high / 2.0))
        if not any(_overlap(tag.box, other.box) for other in tags):
            tags.append(tag)
    return tags


def letters_of(line: int) -> int:
    """Height of the letters of names, where a line of the caption has this height [pixels]."""
    return max(round(SIZE_SHARE * line), LEAST_SIZE)


def write_names(picture: Image.Image, tags: list[NameTag], letters: int, ink: tuple[Color, Color]) -> None:
    """Write names into a picture, with an outline that keeps them readable before any colour."""
    outline = max(1, round(OUTLINE * letters))
    for tag in tags:
        write_outlined(picture, (tag.left, tag.middle), tag.text, letters, ink, anchor="lm", outline=outline)


def _named(frame: Frame, view: ViewSpec) -> Iterator[tuple[str, np.ndarray, float]]:
    """Name, place and radius of what has a name; of a group the middle of its particles, and no radius."""
    position, radius = np.asarray(frame.position, dtype=float), np.asarray(frame.radius, dtype=float)
    groups = [(name, n, 1) for n, name in enumerate(frame.name) if name] if view.labels is True else view.labels
    for name, first, count in groups:
        there = position[first : first + count]
        there = there[np.isfinite(there).all(axis=1)]
        if len(there):
            yield name, there.mean(axis=0), float(radius[first]) if count == 1 else 0.0


def _on_screen(
    place: np.ndarray, radius: np.ndarray, view: ViewSpec, camera: Camera, size: tuple[int, int], shift: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Columns, rows and radii in pixels, and depths [length]; NaN where a place is behind the eye."""
    width, height = size
    seen = camera.view(place)
    depth = seen[:, 2]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        pixel = camera.length_per_pixel(depth, height)
        pixel = np.where(pixel > 0.0, pixel, np.nan)
        drawn = camera.drawn_radius(radius, depth, height, scale=view.radius_scale, minimum_pixels=view.minimum_pixels)
        column = width / 2.0 + seen[:, 0] / pixel + 0.5 * height * shift[0]
        row = height / 2.0 - seen[:, 1] / pixel - 0.5 * height * shift[1]
        return column, row, drawn / pixel, depth


def _is_covered(disc: Disc, others: tuple[np.ndarray, ...]) -> bool:
    """Whether a nearer body covers a whole disc."""
    columns, rows, radii, depths = others
    column, row, radius, depth = disc
    with np.errstate(invalid="ignore"):
        return bool(((np.hypot(columns - column, rows - row) + radius <= radii) & (depths < depth) & (depths > 0.0)).any())


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
