"""The sky: the background as a picture of light. NumPy on the host, drawn anew only when the camera has moved."""

import math

import numpy as np

from mpp_taichi.scene.view_spec import SkySpec
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.srgb import srgb_from_linear
from mpp_taichi.views.textures import Texture, read_picture

FAINTEST = 0.03  # light of the faintest star, where the brightest has 1 and more
STAR_WIDTH = 0.6  # standard deviation of a star's image, pixels of a picture of 720 rows
STAR_REACH = 3  # pixels drawn around a star, in standard deviations
COLOR_SPREAD = 0.35  # between the reddest and the bluest


class Sky:
    """The light behind the scene for one size of picture.

    Stars are spread evenly over the sphere of directions. The number of stars with more light than I follows the law of the
    stars around the Sun, N(> I) ∝ I^(−3/2), cut off at the faintest star. A parallel projection, which has a single
    direction, shows the sky of a perspective picture of 45°.
    """

    def __init__(self, spec: SkySpec, size: tuple[int, int], background: np.ndarray) -> None:
        """Make the stars, or read the picture."""
        self.size, self.background, self.brightness = size, background, spec.brightness
        self._view: tuple[float, ...] | None = None
        self._shown: np.ndarray = np.zeros((1, 1, 3), np.uint8)
        self._texture: Texture | None = read_picture(spec.file) if spec.file is not None else None
        random = np.random.default_rng([spec.seed, 7])
        direction = random.normal(size=(spec.stars, 3))
        self._direction = direction / np.linalg.norm(direction, axis=1)[:, None]
        brightness = FAINTEST * (1.0 - random.random(spec.stars)) ** (-2.0 / 3.0)
        warmth = COLOR_SPREAD * (random.random(spec.stars) - 0.5)
        tint = 1.0 + np.stack([warmth, -0.2 * np.abs(warmth), -warmth], axis=1)
        self._star_light = np.minimum(brightness, 4.0)[:, None] * tint

    def picture(self, camera: Camera) -> np.ndarray:
        """The sky as displayed, uint8, shape (height, width, 3)."""
        angle = 45.0 if camera.orthographic else camera.field_of_view
        view = (*camera.right, *camera.up, angle)
        if view != self._view:
            self._view = view
            focal = self.size[1] / 2.0 / math.tan(math.radians(angle) / 2.0)
            light = self._image(camera, focal) if self._texture is not None else self._stars(camera, focal)
            self._shown = np.rint(255.0 * srgb_from_linear(light)).astype(np.uint8)
        return self._shown

    def _image(self, camera: Camera, focal: float) -> np.ndarray:
        assert self._texture is not None
        width, height = self.size
        x = (np.arange(width) + 0.5 - width / 2.0) / focal
        y = (height / 2.0 - np.arange(height) - 0.5) / focal
        direction = -camera.backward + x[None, :, None] * camera.right + y[:, None, None] * camera.up
        direction /= np.linalg.norm(direction, axis=2)[:, :, None]
        return self.background + self.brightness * self._texture.light(direction)

    def _stars(self, camera: Camera, focal: float) -> np.ndarray:
        width, height = self.size
        light = np.empty((height, width, 3))
        light[:] = self.background
        ahead = -(self._direction @ camera.backward)
        seen = ahead > 0.05
        scale = focal / ahead[seen]
        column = width / 2.0 + scale * (self._direction[seen] @ camera.right)
        row = height / 2.0 - scale * (self._direction[seen] @ camera.up)
        spread = STAR_WIDTH * max(height / 720.0, 1.0)
        reach = math.ceil(STAR_REACH * spread)
        near = (np.abs(column - width / 2.0) < width / 2.0 + reach) & (np.abs(row - height / 2.0) < height / 2.0 + reach)
        column, row, shine = column[near], row[near], self.brightness * self._star_light[seen][near]
        first_column, first_row = np.floor(column).astype(int), np.floor(row).astype(int)
        for down in range(-reach, reach + 1):
            for across in range(-reach, reach + 1):
                x, y = first_column + across, first_row + down
                inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
                square = (x + 0.5 - column) ** 2 + (y + 0.5 - row) ** 2
                weight = np.exp(-square / (2.0 * spread**2))[:, None] * shine
                np.add.at(light, (y[inside], x[inside]), weight[inside])
        return light
