"""Surfaces: textures of bodies, shining bodies and casters of shadows, as tables for the renderer. NumPy on the host."""

import math
from dataclasses import dataclass

import numpy as np

from mpp_taichi.scene.view_spec import SpinSpec, ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views._primitives import FAR
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.lights import COLUMNS, Lights
from mpp_taichi.views.surface_parts import COLORED_LIGHT, SURFACES
from mpp_taichi.views.textures import Texture, make_texture

MOST_CASTERS = 64
"""Most spheres that cast shadows: the largest spheres; of spheres with equal radii all or none."""


@dataclass(frozen=True, eq=False)
class SurfaceTables:
    """The arrays that the renderer's kernel reads; lengths in camera distances, places in camera coordinates.

    marks     of every particle: its row in `material`, −1 for none, and its index; shape (particle_count, 2)
    material  0…8: prime meridian, 90° east of it and north pole as directions; 9: 1 where it shines; shape (rows, 10)
    place     of the texture: first texel, columns, rows; 0 columns where it has none; shape (rows, 3)
    texels    of all textures, red | green << 8 | blue << 16 as displayed, rows from the north, from −180° eastward
    lights    as in lights.py
    casters   place, radius and index of the spheres that cast shadows, shape (count, 5)
    glow_count  the first lights are bodies, which glow
    """

    marks: np.ndarray
    material: np.ndarray
    place: np.ndarray
    texels: np.ndarray
    lights: np.ndarray
    casters: np.ndarray
    glow_count: int = 0

    @staticmethod
    def none() -> "SurfaceTables":
        """Tables of a view without such bodies: one row each, since no array of a kernel may be empty."""
        floats = [np.zeros((1, columns), np.float32) for columns in (10, COLUMNS, 5)]
        return SurfaceTables(
            np.zeros((0, 2)), floats[0], np.zeros((1, 3), np.int32), np.zeros(1, np.uint32), floats[1], floats[2]
        )


class Surfaces:
    """The bodies of a view that have a texture or shine; textures are made, or read, for the first picture."""

    def __init__(self, spec: ViewSpec) -> None:
        """Find the bodies with a texture and the bodies that shine."""
        self.bodies = {key: body for key, body in spec.bodies.items() if body.light is not None or body.texture is not None}
        self._textures: list[tuple[Texture, list[int]] | None] | None = None  # textures, and the first texel of each level
        self._texels = np.zeros(1, np.uint32)
        self._lights = Lights(spec)
        asked = bool(self.bodies or spec.light)
        self.parts: int = SURFACES * asked | COLORED_LIGHT * self._lights.colored
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
        if self._textures is None:
            self._read(frame)
        assert self._textures is not None
        count = len(center)
        marks = np.stack([np.full(count, -1.0), np.arange(count, dtype=float)], axis=1)
        material = np.zeros((max(len(self.bodies), 1), 10), np.float32)
        place = np.zeros((max(len(self.bodies), 1), 3), np.int32)
        shining = self._lights.shining(count)
        per_pixel = camera.length_per_pixel(center[:, 2] * camera.distance, rows) / camera.distance
        entries = enumerate(zip(self.bodies.items(), self._textures, strict=True))
        for row, (((first, group), body), found) in entries:
            marks[first : first + group, 0] = row
            material[row, :9] = _orientation(body.spin, frame.time, camera).ravel()
            material[row, 9] = body.light is not None
            if found is not None:
                texture, starts = found
                part = slice(first, first + group)
                with np.errstate(divide="ignore", invalid="ignore"):
                    pixels = np.nan_to_num(drawn[part] / per_pixel[part], posinf=1e6)
                level = texture.level_for(float(pixels.max(initial=1.0)))
                height, width = texture.levels[level].shape[:2]
                place[row] = starts[level], width, height
        there = (np.abs(center) < FAR).all(axis=1) & (size < FAR)
        lit_by = np.nonzero(there & shining)[0]
        lights = self._lights.rows(frame.color, camera, center, drawn, lit_by)
        casters = _casters(center, size, there & ~shining & (size > 0.0))
        return SurfaceTables(marks, material, place, self._texels, lights, casters, len(lit_by))

    def _read(self, frame: Frame) -> None:
        self._textures, taken = [], 1
        parts: list[np.ndarray] = [np.zeros(1, np.uint32)]
        for (first, _), body in self.bodies.items():
            if body.texture is None:
                self._textures.append(None)
                continue
            texture = make_texture(body.texture, tuple(float(value) for value in frame.color[first]))
            starts = []
            for level in texture.levels:
                starts.append(taken)
                texels = level.reshape(-1, 3).astype(np.uint32)
                parts.append(texels[:, 0] | texels[:, 1] << 8 | texels[:, 2] << 16)
                taken += len(texels)
            self._textures.append((texture, starts))
        self._texels = np.concatenate(parts, dtype=np.uint32)


def _orientation(spin: SpinSpec | None, time: float, camera: Camera) -> np.ndarray:
    """Directions of the prime meridian, of 90° east and of the north pole in camera coordinates, shape (3, 3).

    The prime meridian is turned by W = phase + 2π t / period from where the equator rises through the x–y plane, as the
    International Astronomical Union counts rotations  [Archinal et al. 2018, Celest. Mech. Dyn. Astron. 130, 22].
    """
    axis = np.array(spin.axis if spin is not None else (0.0, 0.0, 1.0), dtype=float)
    axis /= np.linalg.norm(axis)
    node = np.array([-axis[1], axis[0], 0.0])
    length = float(np.linalg.norm(node))
    node = node / length if length > 1e-12 else np.array([1.0, 0.0, 0.0])
    angle = spin.phase + 2.0 * math.pi * math.fmod(time / spin.period, 1.0) if spin is not None else 0.0
    east = np.cross(axis, node)
    meridian = math.cos(angle) * node + math.sin(angle) * east
    frame = np.stack([meridian, np.cross(axis, meridian), axis])
    return np.asarray(frame @ np.stack([camera.right, camera.up, -camera.backward], axis=1))


def _casters(center: np.ndarray, size: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    index = np.nonzero(chosen)[0]
    if len(index) > MOST_CASTERS:
        next_largest = np.partition(size[index], -MOST_CASTERS - 1)[-MOST_CASTERS - 1]
        index = index[size[index] > next_largest]
    return np.concatenate([center[index], size[index, None], index[:, None]], axis=1).astype(np.float32)
