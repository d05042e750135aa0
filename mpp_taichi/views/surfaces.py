"""Surfaces: textures of bodies, shining bodies and casters of shadows, as tables for the renderer. NumPy on the host."""

from dataclasses import dataclass, replace

import numpy as np

from mpp_taichi.scene.body_view_spec import BodyViewSpec, SpinSpec
from mpp_taichi.scene.view_spec import ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views._primitives import FAR
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.lights import COLUMNS, Lights
from mpp_taichi.views.rings import Rings
from mpp_taichi.views.spins import orientation
from mpp_taichi.views.surface_maps import SurfaceMap, maps_of
from mpp_taichi.views.surface_parts import (
    BRIGHTNESS,
    CLOUD_AXES,
    CLOUDS,
    COLORED_LIGHT,
    GLOSS,
    MATERIAL_COLUMNS,
    NIGHT,
    OPACITY,
    PLACE_COLUMNS,
    RELIEF,
    RING_COLUMNS,
    RINGS,
    SHINES,
    STRENGTH,
    SURFACE_AXES,
    SURFACES,
)

MOST_CASTERS = 64
"""Most spheres that cast shadows: the largest spheres; of spheres with equal radii all or none."""


@dataclass(frozen=True, eq=False)
class SurfaceTables:
    """The arrays that the renderer's kernel reads; lengths in camera distances, places in camera coordinates.

    marks     of every particle: its row in `material`, −1 for none, and its index; shape (particle_count, 2)
    material, place   columns as in surface_parts.py
    texels    of all maps, rows from the north, from −180° eastward: red | green << 8 | blue << 16 as displayed, of clouds
              times the opacity and | opacity << 24; slopes as in relief.py; of highlights shares of the light
    lights    as in lights.py
    casters   place, radius and index of the spheres that cast shadows, shape (count, 5)
    rings     columns as in surface_parts.py, the farthest ring first, shape (count, RING_COLUMNS)
    glow_count  the first lights are bodies, which glow
    """

    marks: np.ndarray
    material: np.ndarray
    place: np.ndarray
    texels: np.ndarray
    lights: np.ndarray
    casters: np.ndarray
    rings: np.ndarray
    glow_count: int = 0

    @staticmethod
    def none() -> "SurfaceTables":
        """Tables of a view without such bodies: one row each, since no array of a kernel may be empty."""
        floats = [np.zeros((1, columns), np.float32) for columns in (MATERIAL_COLUMNS, COLUMNS, 5, RING_COLUMNS)]
        place, texels = np.zeros((1, PLACE_COLUMNS), np.int32), np.zeros(1, np.uint32)
        return SurfaceTables(np.zeros((0, 2)), floats[0], place, texels, floats[1], floats[2], floats[3][:0])


class Surfaces:
    """The bodies of a view that have a surface or shine; their maps are made, or read, for the first picture."""

    def __init__(self, spec: ViewSpec) -> None:
        """Find the bodies with a surface and the bodies that shine."""
        self.bodies = {key: body for key, body in spec.bodies.items() if body.light is not None or _parts(body)}
        self._maps: list[dict[int, tuple[SurfaceMap, list[int]]]] | None = None  # maps, and the first texel of each level
        self._texels = np.zeros(1, np.uint32)
        self._lights, self._rings = Lights(spec), Rings(spec)
        asked = bool(self.bodies or spec.light)
        self.parts: int = SURFACES * asked | COLORED_LIGHT * self._lights.colored
        for body in self.bodies.values():
            self.parts |= _parts(body)
        """The parts of shading that the pictures need; 0 where no body has a texture or shines, and no light casts shadows."""

    def __bool__(self) -> bool:
        """Whether a body has a texture or shines, or the light casts shadows."""
        return self.parts > 0

    def tables(
        self, frame: Frame, camera: Camera, center: np.ndarray, size: np.ndarray, drawn: np.ndarray, rows: int
    ) -> SurfaceTables:
        """Tables for a picture with this number of rows.

        Places `center` in camera coordinates, true radii `size` and radii as `drawn`, all in camera distances.
        """
        if self._maps is None:
            self._read(frame)
        assert self._maps is not None
        count = len(center)
        marks = np.stack([np.full(count, -1.0), np.arange(count, dtype=float)], axis=1)
        material = np.zeros((max(len(self.bodies), 1), MATERIAL_COLUMNS), np.float32)
        place = np.zeros((max(len(self.bodies), 1), PLACE_COLUMNS), np.int32)
        shining = self._lights.shining(count)
        per_pixel = camera.length_per_pixel(center[:, 2] * camera.distance, rows) / camera.distance
        entries = enumerate(zip(self.bodies.items(), self._maps, strict=True))
        for row, (((first, group), body), found) in entries:
            marks[first : first + group, 0] = row
            material[row] = _material(body, frame.time, camera)
            part = slice(first, first + group)
            with np.errstate(divide="ignore", invalid="ignore"):
                pixels = float(np.nan_to_num(drawn[part] / per_pixel[part], posinf=1e6).max(initial=1.0))
            for at, (surface, starts) in found.items():
                level = surface.level_for(pixels)
                height, width = surface.levels[level].shape
                place[row, at : at + 3] = starts[level], width, height
        there = (np.abs(center) < FAR).all(axis=1) & (size < FAR)
        lit_by = np.nonzero(there & shining)[0]
        lights = self._lights.rows(frame.color, camera, center, drawn, lit_by)
        casters = _casters(center, size, there & ~shining & (size > 0.0))
        rings = self._rings.rows(frame.time, camera, center, drawn)
        return SurfaceTables(marks, material, place, self._texels, lights, casters, rings, len(lit_by))

    def _read(self, frame: Frame) -> None:
        profiles = self._rings.read(frame.color)  # at the beginning, where single precision counts them exactly
        self._maps, taken = [], len(profiles)
        parts: list[np.ndarray] = [profiles]
        for (first, _), body in self.bodies.items():
            self._maps.append({})
            for at, surface in maps_of(body, tuple(float(value) for value in frame.color[first])).items():
                starts = []
                for level in surface.levels:
                    starts.append(taken)
                    parts.append(level.ravel())
                    taken += level.size
                self._maps[-1][at] = surface, starts
        self._texels = np.concatenate(parts, dtype=np.uint32)


def _parts(body: BodyViewSpec) -> int:
    """The parts of shading for the maps of a body."""
    found = 0
    parts = (SURFACES, NIGHT, CLOUDS, RELIEF, RINGS, GLOSS)
    maps = (body.texture, body.night, body.clouds, body.normal, body.ring, body.specular)
    for asked, part in zip(maps, parts, strict=True):
        if asked is not None:
            found |= SURFACES | part
    return found


def _material(body: BodyViewSpec, time: float, camera: Camera) -> np.ndarray:
    """The row of a body in `SurfaceTables.material`."""
    row = np.zeros(MATERIAL_COLUMNS)
    row[SURFACE_AXES : SURFACE_AXES + 9] = orientation(body.spin, time, camera).ravel()
    row[SHINES] = body.light is not None
    if body.clouds is not None:
        spin = body.spin
        if body.clouds.period is not None:
            spin = replace(spin or SpinSpec(body.clouds.period), period=body.clouds.period)
        row[CLOUD_AXES : CLOUD_AXES + 9] = orientation(spin, time, camera).ravel()
        row[OPACITY] = body.clouds.opacity
    if body.night is not None:
        row[BRIGHTNESS] = body.night.brightness
    if body.specular is not None:
        row[STRENGTH] = body.specular.strength
    return row


def _casters(center: np.ndarray, size: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    index = np.nonzero(chosen)[0]
    if len(index) > MOST_CASTERS:
        next_largest = np.partition(size[index], -MOST_CASTERS - 1)[-MOST_CASTERS - 1]
        index = index[size[index] > next_largest]
    return np.concatenate([center[index], size[index, None], index[:, None]], axis=1).astype(np.float32)
