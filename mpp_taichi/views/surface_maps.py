"""Surface maps: texture, lights at night, clouds, slopes and highlights of a body as texels for the renderer. NumPy only."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from PIL import Image

from mpp_taichi.errors import OutputError
from mpp_taichi.scene.body_view_spec import BodyViewSpec, CloudsSpec, NightSpec, NormalSpec, SpecularSpec
from mpp_taichi.views.map_patterns import cloud_picture, gloss_picture, height_picture, night_picture
from mpp_taichi.views.relief import packed_slopes, slopes_of_heights, slopes_of_picture
from mpp_taichi.views.srgb import srgb_from_linear
from mpp_taichi.views.surface_parts import CLOUDS_AT, GLOSS_AT, NIGHT_AT, RELIEF_AT, TEXTURE_AT
from mpp_taichi.views.textures import LEVELS, SMALLEST_LEVEL, WIDEST, Texture, make_texture, read_picture


@dataclass(frozen=True, eq=False)
class SurfaceMap:
    """Texels of a sphere's surface in levels, uint32, each half the size of the level before; longitude as in textures.py."""

    levels: tuple[np.ndarray, ...]

    def level_for(self, pixels: float) -> int:
        """The level whose texels are about as large as pixels, for a sphere with a radius of this number of pixels."""
        texels = self.levels[0].shape[1] / (2.0 * math.pi * max(pixels, 1e-3))  # across a pixel, at the middle of the disk
        return int(np.clip(round(math.log2(max(texels, 1.0))), 0, len(self.levels) - 1))


def maps_of(body: BodyViewSpec, color: tuple[float, ...]) -> dict[int, SurfaceMap]:
    """The maps that a body has, by their columns in `SurfaceTables.place`."""
    found = {}
    if body.texture is not None:
        found[TEXTURE_AT] = _of_colors(make_texture(body.texture, color))
    if body.night is not None:
        found[NIGHT_AT] = _night(body.night)
    if body.clouds is not None:
        found[CLOUDS_AT] = _clouds(body.clouds)
    if body.normal is not None:
        found[RELIEF_AT] = _relief(body.normal)
    if body.specular is not None:
        found[GLOSS_AT] = _gloss(body.specular)
    return found


def _of_colors(texture: Texture) -> SurfaceMap:
    return SurfaceMap(tuple(_packed(level.astype(np.uint32)) for level in texture.levels))


def _packed(level: np.ndarray) -> np.ndarray:
    """Red | green << 8 | blue << 16, and where there is a fourth channel | opacity << 24."""
    return np.asarray(sum(level[..., channel] << np.uint32(8 * channel) for channel in range(level.shape[2])))


@lru_cache(maxsize=16)
def _night(spec: NightSpec) -> SurfaceMap:
    if spec.file is not None:
        return _of_colors(read_picture(spec.file))
    assert spec.pattern is not None
    return _of_colors(Texture.of(night_picture(spec.pattern, spec.seed)))


@lru_cache(maxsize=16)
def _clouds(spec: CloudsSpec) -> SurfaceMap:
    """Light of the clouds times their opacity, as displayed, and the opacity."""
    picture = cloud_picture(spec.pattern, spec.seed) if spec.pattern is not None else picture_with_opacity(spec.file or "")
    opacity = picture[..., 3:] / 255.0
    light = np.concatenate([LEVELS[picture[..., :3]] * opacity, opacity], axis=2)

    def texels(light: np.ndarray) -> np.ndarray:
        shown = np.concatenate([srgb_from_linear(light[..., :3]), light[..., 3:]], axis=2)
        return _packed(np.rint(255.0 * shown).astype(np.uint32))

    return SurfaceMap(tuple(_halved(light, texels)))


def picture_with_opacity(path: str, *, color: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> np.ndarray:
    """A picture file as red, green, blue and opacity, uint8; without transparency its brightness is the opacity of a colour."""
    try:
        with Image.open(path) as image:
            clear = image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info
            channels = np.asarray(_no_wider(image.convert("RGBA" if clear else "L")))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise OutputError(f"{path}: cannot read the picture: {error}") from None
    if clear:
        return channels
    shown = np.broadcast_to(np.rint(255.0 * np.array(color)), (*channels.shape, 3))
    return np.concatenate([shown, channels[..., None]], axis=2).astype(np.uint8)


def _no_wider(image: Image.Image) -> Image.Image:
    width, height = image.size
    if width <= WIDEST:
        return image
    return image.resize((WIDEST, max(1, height * WIDEST // width)), Image.Resampling.BOX)


@lru_cache(maxsize=16)
def _relief(spec: NormalSpec) -> SurfaceMap:
    if spec.pattern is not None:
        slopes = slopes_of_heights(height_picture(spec.pattern, spec.seed), spec.strength)
    else:
        slopes = slopes_of_picture(read_picture(spec.file or "").levels[0], spec.strength)
    return SurfaceMap(tuple(_halved(slopes, packed_slopes)))


@lru_cache(maxsize=16)
def _gloss(spec: SpecularSpec) -> SurfaceMap:
    """Shares of the light, from 0 to 255; they are numbers and no displayed colours, so their means are taken as they are."""
    if spec.pattern is not None:
        picture = gloss_picture(spec.pattern, spec.seed)
    else:
        picture = read_picture(spec.file or "").levels[0]
    return SurfaceMap(tuple(_halved(picture.astype(float), lambda values: _packed(np.rint(values).astype(np.uint32)))))


def _halved(values: np.ndarray, texels: Callable[[np.ndarray], np.ndarray]) -> Iterator[np.ndarray]:
    """The texels of values (rows, columns, channels), and of ever smaller means over four."""
    yield texels(values)
    while values.shape[0] >= 2 * SMALLEST_LEVEL and values.shape[1] >= 2 * SMALLEST_LEVEL:
        values = values[: values.shape[0] // 2 * 2, : values.shape[1] // 2 * 2]
        values = (values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]) / 4.0
        yield texels(values)
