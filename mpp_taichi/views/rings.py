"""Rings around bodies as rows and texels for the renderer's kernel. NumPy on the host."""

from functools import lru_cache

import numpy as np

from mpp_taichi.scene.body_view_spec import RingSpec
from mpp_taichi.scene.view_spec import ViewSpec
from mpp_taichi.views._primitives import FAR, TILE, Screen, spheres
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.ring_patterns import ring_profile
from mpp_taichi.views.spins import orientation
from mpp_taichi.views.srgb import srgb_from_linear
from mpp_taichi.views.surface_maps import picture_with_opacity
from mpp_taichi.views.surface_parts import RING_COLUMNS, RING_TEXELS
from mpp_taichi.views.textures import LEVELS

UNIFORM = 0.7  # opacity of a ring without a texture


class Rings:
    """The rings of one view; their profiles are made, or read, for the first picture."""

    def __init__(self, spec: ViewSpec) -> None:
        """Find the bodies with rings."""
        self._bodies = [(key, body, body.ring) for key, body in spec.bodies.items() if body.ring is not None]

    def read(self, color: np.ndarray) -> np.ndarray:
        """The texels of all rings, one behind the other after a first unused texel, for displayed colours of the particles."""
        profiles = [_profile(ring, tuple(map(float, ring.color or color[first]))) for (first, _), _, ring in self._bodies]
        return np.concatenate([np.zeros(1, np.uint32), *profiles])

    def rows(self, time: float, camera: Camera, center: np.ndarray, drawn: np.ndarray) -> np.ndarray:
        """Rows of the rings in camera coordinates and distances, the farthest first, shape (count, RING_COLUMNS)."""
        rows = []
        for number, ((first, group), body, ring) in enumerate(self._bodies):
            pole = orientation(body.spin, time, camera)[2]
            for index in range(first, min(first + group, len(center))):
                radius = drawn[index]
                if radius > 0.0 and (np.abs(center[index]) < FAR).all() and radius * ring.outer < FAR:
                    edges = radius * ring.inner, radius * (ring.outer - ring.inner)
                    rows.append([*center[index], *pole, *edges, 1.0 + (2 * RING_TEXELS - 1) * number])
        table = np.array(rows, dtype=np.float32).reshape(-1, RING_COLUMNS)
        return table[np.argsort(-table[:, 2], kind="stable")]


def tiles_with_rings(rings: np.ndarray, screen: Screen) -> np.ndarray:
    """Which tiles of a picture a ring may reach, as flags in the order of tiles."""
    found = np.zeros((screen.tiles_down, screen.tiles_across), dtype=bool)
    for ring in rings.astype(float):
        middle, reach = ring[None, :3], ring[6:7] + ring[7:8]
        if not screen.orthographic and (middle**2).sum() <= 1.001 * reach[0] ** 2:
            found[:] = True  # the camera is within the sphere around the ring
            continue
        for left, right, top, bottom in spheres(middle, reach, np.zeros((1, 3)), screen)[:, :4] / TILE:
            rows = slice(max(int(top), 0), max(int(np.ceil(bottom)), 0))
            found[rows, max(int(left), 0) : max(int(np.ceil(right)), 0)] = True
    return found.ravel()


@lru_cache(maxsize=32)
def _profile(ring: RingSpec, color: tuple[float, float, float]) -> np.ndarray:
    """Red | green << 8 | blue << 16 | opacity << 24 from the inner to the outer edge, and of ever fewer means of these."""
    if ring.texture is None:
        picture = np.broadcast_to(np.array([*color, 1.0]), (RING_TEXELS, 4))
    elif ring.texture.pattern is not None:
        picture = ring_profile(ring.texture.pattern, ring.texture.seed, color, RING_TEXELS)
    else:
        picture = picture_with_opacity(ring.texture.file or "", color=color).mean(axis=0) / 255.0
        place = (np.arange(RING_TEXELS) + 0.5) / RING_TEXELS * len(picture) - 0.5
        picture = np.stack([np.interp(place, np.arange(len(picture)), each) for each in picture.T], axis=1)
    factor = ring.opacity if ring.opacity is not None else UNIFORM if ring.texture is None else 1.0
    opacity = factor * picture[:, 3:]
    light = LEVELS[np.rint(255.0 * picture[:, :3]).astype(int)].astype(float)
    found = []
    while True:
        shown = np.rint(255.0 * np.concatenate([srgb_from_linear(light), opacity], axis=1)).astype(np.uint32)
        found.append(shown[:, 0] | shown[:, 1] << 8 | shown[:, 2] << 16 | shown[:, 3] << 24)
        if len(light) == 1:
            return np.concatenate(found, dtype=np.uint32)
        weight = opacity.reshape(-1, 2, 1)
        total = weight.sum(axis=1)
        mean = (light.reshape(-1, 2, 3) * weight).sum(axis=1) / np.maximum(total, 1e-12)
        light = np.where(total > 0.0, mean, light.reshape(-1, 2, 3).mean(axis=1))
        opacity = total / 2.0
