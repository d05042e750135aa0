"""Ink: smooth lines and discs in pictures, by masks that are finer than the picture."""

from dataclasses import dataclass, field

import numpy as np
from PIL import Image, ImageDraw

from mpp_taichi.plots.theme import Rgb

FINER = 3  # pixels of a mask along a pixel of the picture, which smooths the edges of curves
LONG = 5000  # points of a line; the joints of a longer line are not rounded


@dataclass(eq=False)
class Ink:
    """A curve as a mask of the field, `FINER` times as fine as the picture along both sides."""

    color: Rgb
    width: float
    size: tuple[int, int]
    _mask: Image.Image = field(init=False)

    def __post_init__(self) -> None:
        self._mask = Image.new("L", self.size)

    def draw(self, points: np.ndarray) -> list[tuple[int, int, int, int]]:
        """Draw a line through points (n, 2), pixels of the field; points that are not finite are gaps. The changed boxes."""
        finite = np.isfinite(points).all(axis=1)
        wide = max(1, round(FINER * self.width))
        limit = 4.0 * max(self.size)
        boxes, pen = [], ImageDraw.Draw(self._mask)
        for run in np.split(np.arange(len(points)), np.flatnonzero(np.diff(finite.astype(int))) + 1):
            if len(run) == 0 or not finite[run[0]]:
                continue
            fine = np.clip(FINER * points[run], -limit, limit)
            path = [tuple(each) for each in fine.tolist()]
            if len(path) > 1:
                pen.line(path, fill=255, width=wide, joint="curve" if len(path) < LONG else None)
            box = self._box(fine, wide)
            boxes += [box] if box[2] > box[0] and box[3] > box[1] else []
        return boxes

    def _box(self, fine: np.ndarray, wide: int) -> tuple[int, int, int, int]:
        low = np.floor((fine.min(axis=0) - wide) / FINER).astype(int)
        high = np.ceil((fine.max(axis=0) + wide) / FINER).astype(int) + 1
        (left, top), (right, bottom) = np.maximum(low, 0), np.minimum(high, np.array(self.size) // FINER)
        return int(left), int(top), int(right), int(bottom)

    def cover(self, box: tuple[int, int, int, int]) -> Image.Image:
        """The coverage of each pixel inside a box, 0…255."""
        left, top, right, bottom = box
        return self._mask.reduce(FINER, (FINER * left, FINER * top, FINER * right, FINER * bottom))


def put_disc(picture: Image.Image, point: np.ndarray, radius: float, color: Rgb) -> None:
    """A smooth disc about a point."""
    x0, y0 = int(np.floor(point[0] - radius - 1)), int(np.floor(point[1] - radius - 1))
    side = int(2 * radius + 4)
    across = np.arange(side) + 0.5
    distance = np.hypot(across[None, :] + x0 - point[0], across[:, None] + y0 - point[1])
    mask = np.clip(255.0 * (radius - distance + 0.5), 0.0, 255.0).astype(np.uint8)
    picture.paste(color, (x0, y0, x0 + side, y0 + side), Image.fromarray(mask))
