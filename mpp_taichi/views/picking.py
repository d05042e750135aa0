"""Picking: the particle under the cursor, by the projection of the program's own camera, and the text about it."""

import math
from dataclasses import dataclass

import numpy as np

from mpp_taichi.scene.spec import ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera

REACH = 6.0  # pixels by which a click may miss a particle
CORNERS = 48  # of a ring
CLEARANCE = 4.0  # pixels between a particle and its ring
NEAREST_DEPTH = 1e-3  # in camera distances, as for GGUI


@dataclass(frozen=True, eq=False)
class Discs:
    """Places of particles in a window: middles in pixels from the lower left corner, radii in pixels, depths [length]."""

    middle: np.ndarray
    radius: np.ndarray
    depth: np.ndarray


def discs(
    frame: Frame, camera: Camera, view: ViewSpec, size: tuple[int, int], shift: tuple[float, float] = (0.0, 0.0)
) -> Discs:
    """All particles of a frame; `shift` moves the picture to the right and up, in halves of the window's height.

    The middle of a particle behind the camera, or of a merged particle, is NaN.
    """
    seen = camera.view(frame.position)
    depth = seen[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixel = camera.length_per_pixel(depth, size[1])
        radius = camera.drawn_radius(frame.radius, depth, size[1], scale=view.radius_scale, minimum_pixels=view.minimum_pixels)
        middle = 0.5 * np.array(size) + seen[:, :2] / pixel[:, None] + 0.5 * size[1] * np.array(shift)
        there = (depth > NEAREST_DEPTH * camera.distance)[:, None]
        return Discs(np.where(there, middle, np.nan), radius / pixel, depth)


def pick(drawn: Discs, cursor: tuple[float, float], size: tuple[int, int]) -> int | None:
    """The nearest particle under the cursor (0…1 from the lower left corner), else the closest within `REACH`, or None."""
    away = np.linalg.norm(drawn.middle - np.array(cursor) * np.array(size), axis=1) - drawn.radius
    away = np.where(np.isnan(away), np.inf, away)
    under = np.flatnonzero(away <= 0.0)
    if len(under):
        return int(under[np.argmin(drawn.depth[under])])
    return int(np.argmin(away)) if len(away) and away.min() <= REACH else None


def ring(drawn: Discs, index: int, size: tuple[int, int]) -> np.ndarray:
    """A circle about a particle as segments, ends in 0…1 from the lower left corner, shape (2 CORNERS, 2)."""
    angle = np.linspace(0.0, 2.0 * math.pi, CORNERS + 1)
    corners = drawn.middle[index] + (drawn.radius[index] + CLEARANCE) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.stack([corners[:-1], corners[1:]], axis=1).reshape(-1, 2) / np.array(size)


def described(frame: Frame, index: int) -> list[str]:
    """Name and number, place, velocity and mass of a particle, a line each."""
    name = frame.name[index] if frame.name else ""
    lines = [f"particle {index}" + (f", {name}" if name else "")]
    lines.append("x = " + _vector(frame.position[index]))
    if frame.velocity is not None:
        velocity = frame.velocity[index]
        lines.append(f"v = {_vector(velocity)}   |v| = {np.linalg.norm(velocity):.5g}")
    if frame.mass is not None:
        lines.append(f"m = {frame.mass[index]:.5g}")
    return lines


def _vector(vector: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.5g}" for value in vector) + ")"
