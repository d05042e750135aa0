"""Textures: the surfaces of bodies as pictures of longitude and latitude, from a file or from a pattern. Host only."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from PIL import Image

from mpp_taichi.errors import OutputError
from mpp_taichi.scene.body_view_spec import TextureSpec
from mpp_taichi.views.patterns import pattern_picture
from mpp_taichi.views.srgb import linear_from_srgb, srgb_from_linear

WIDEST = 4096  # texels in a row; larger pictures are reduced
SMALLEST_LEVEL = 8  # texels in a column
LEVELS = np.asarray(linear_from_srgb(np.arange(256) / 255.0), dtype=np.float32)
"""Light of the 256 values of a texel."""


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture of a sphere's surface in levels, each half the size of the level before, sRGB as uint8.

    Longitude runs from −180° to 180° from left to right, north is on top.
    """

    levels: tuple[np.ndarray, ...]

    @staticmethod
    def of(picture: np.ndarray) -> "Texture":
        """The texture of a picture, uint8, shape (rows, columns, 3 or more)."""
        return Texture(_halved(picture))

    def light(self, direction: np.ndarray) -> np.ndarray:
        """Light of the surface in unit directions (…, 3), interpolated between the four nearest texels."""
        texels = self.levels[0]
        height, width = texels.shape[:2]
        u = (np.arctan2(direction[..., 1], direction[..., 0]) / (2.0 * np.pi) + 0.5) * width - 0.5
        v = np.clip(np.arccos(np.clip(direction[..., 2], -1.0, 1.0)) / np.pi * height - 0.5, 0.0, height - 1.0)
        column, row = np.floor(u).astype(int), np.floor(v).astype(int)
        s, t = (u - column)[..., None], (v - row)[..., None]
        below = np.minimum(row + 1, height - 1)
        left, right = column % width, (column + 1) % width
        upper = (1.0 - s) * LEVELS[texels[row, left]] + s * LEVELS[texels[row, right]]
        lower = (1.0 - s) * LEVELS[texels[below, left]] + s * LEVELS[texels[below, right]]
        return np.asarray((1.0 - t) * upper + t * lower)


def make_texture(spec: TextureSpec, color: tuple[float, ...]) -> Texture:
    """The texture of a body: read from the file of the spec, or a pattern in shades of the body's colour."""
    if spec.file is not None:
        return read_picture(spec.file)
    assert spec.pattern is not None
    return _pattern(spec.pattern, spec.seed, color)


@lru_cache(maxsize=64)
def _pattern(name: str, seed: int, color: tuple[float, ...]) -> Texture:
    return Texture.of(pattern_picture(name, seed, color))


@lru_cache(maxsize=32)
def read_picture(path: str) -> Texture:
    """The texture in a picture file of any format that Pillow reads.

    Raises:
        OutputError: the file cannot be read.
    """
    try:
        with Image.open(path) as image:
            width, height = image.size
            rgb = image.convert("RGB")
            if width > WIDEST:
                rgb = rgb.resize((WIDEST, max(1, height * WIDEST // width)), Image.Resampling.BOX)
            return Texture.of(np.asarray(rgb))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise OutputError(f"{path}: cannot read the picture: {error}") from None


def _halved(picture: np.ndarray) -> tuple[np.ndarray, ...]:
    """The picture and its reduced levels; each texel is the mean light of four texels of the level before."""
    levels = [np.ascontiguousarray(picture[:, :, :3], dtype=np.uint8)]
    light = LEVELS[levels[0]]
    while light.shape[0] >= 2 * SMALLEST_LEVEL and light.shape[1] >= 2 * SMALLEST_LEVEL:
        light = light[: light.shape[0] // 2 * 2, : light.shape[1] // 2 * 2]
        light = (light[::2, ::2] + light[1::2, ::2] + light[::2, 1::2] + light[1::2, 1::2]) / 4.0
        levels.append(np.rint(255.0 * srgb_from_linear(light)).astype(np.uint8))
    return tuple(levels)
