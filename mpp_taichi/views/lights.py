"""Lights: bodies that shine and lights from afar, as rows for the renderer's kernel. NumPy on the host."""

import math

import numpy as np

from mpp_taichi.scene.body_view_spec import BodyLightSpec
from mpp_taichi.scene.view_spec import LightSpec, ViewSpec
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.srgb import linear_from_srgb

AFAR = 1.0e4  # camera distances to a distant light
WHITE = (1.0, 1.0, 1.0)
COLUMNS = 10
"""0…2: place, 3: radius, 4…6: light of the glow in red, green, blue; 7…9: light on other bodies."""


class Lights:
    """The lights of one view.

    A single light is white, as if the camera had adapted to it; of several lights each has its colour.
    """

    def __init__(self, spec: ViewSpec) -> None:
        """Find the bodies that shine, and count the lights."""
        self._bodies = {key: body.light for key, body in spec.bodies.items() if body.light is not None}
        self._afar = spec.light
        self._several = sum(count for _, count in self._bodies) + len(spec.light) > 1

    @property
    def colored(self) -> bool:
        """Whether the light on other bodies may have a colour or a brightness."""
        given: list[BodyLightSpec | LightSpec] = [*self._bodies.values(), *self._afar]
        return self._several or any(light.color not in (None, WHITE) or light.brightness != 1.0 for light in given)

    def shining(self, count: int) -> np.ndarray:
        """Which of this number of particles shine, shape (count,)."""
        shines = np.zeros(count, dtype=bool)
        for first, group in self._bodies:
            shines[first : first + group] = True
        return shines

    def rows(self, color: np.ndarray, camera: Camera, center: np.ndarray, drawn: np.ndarray, lit_by: np.ndarray) -> np.ndarray:
        """Rows (count, COLUMNS): first the particles `lit_by`, which glow, and then the lights from afar.

        Displayed colours (particle_count, 3); places in camera coordinates and radii as drawn, in camera distances.
        """
        glow = linear_from_srgb(color)
        cast = glow / np.maximum(glow.max(axis=1, initial=0.0, keepdims=True), 1e-6) if self._several else np.ones_like(glow)
        for (first, group), light in self._bodies.items():
            if light.color is not None:
                cast[first : first + group] = linear_from_srgb(np.array(light.color))
            cast[first : first + group] *= light.brightness
        bodies = np.concatenate([center[lit_by], drawn[lit_by, None], glow[lit_by], cast[lit_by]], axis=1)
        return np.concatenate([bodies, *(_row(light, camera) for light in self._afar)], dtype=np.float32)


def _row(spec: LightSpec, camera: Camera) -> np.ndarray:
    """The row of a distant sphere without a glow."""
    direction = np.array(spec.direction, dtype=float)
    place = AFAR * np.stack([camera.right, camera.up, -camera.backward]) @ direction / np.linalg.norm(direction)
    light = spec.brightness * linear_from_srgb(np.array(spec.color))
    return np.array([[*place, AFAR * math.tan(math.radians(spec.angular_radius)), 0.0, 0.0, 0.0, *light]])
