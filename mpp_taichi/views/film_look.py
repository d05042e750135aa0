"""The look of films in a window: the picture that a film would have, drawn by the program's own renderer."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from mpp_taichi.scene.spec import ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.appearance import Appearance
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import draw_caption
from mpp_taichi.views.panels import Division, widened, widening
from mpp_taichi.views.renderer import Renderer
from mpp_taichi.views.trails import DrawnTrails, Trails


@contextmanager
def seeing(camera: Camera, factor: float) -> Iterator[None]:
    """A block in which a camera sees a height larger by a factor; a zoom within the block remains."""
    angle, height = camera.field_of_view, camera.height
    camera.field_of_view, camera.height = widened(angle, factor), factor * height
    try:
        yield
    finally:
        camera.field_of_view = angle
        camera.height = height if camera.height == factor * height else camera.height / factor


class FilmLook:
    """Draws pictures of any size as a film has them, with the appearance, the camera and the trails of a window."""

    def __init__(self, spec: ViewSpec, dimensions: int, appearance: Appearance, film_size: tuple[int, int]) -> None:
        """`film_size` is the size of the scene's films: all that a film shows is in the window, whatever its shape."""
        self.spec, self.film_size = spec, film_size
        plain = replace(spec, caption=False)
        self._renderer = Renderer(plain, film_size, dimensions=dimensions, appearance=appearance)

    def factor(self, part: tuple[int, int]) -> float:
        """How much higher the camera must see so that the scene's part of a window shows all that a film shows."""
        return widening(self.spec.camera, self.film_size, part)

    def picture(
        self,
        frame: Frame,
        camera: Camera,
        trails: DrawnTrails | None,
        size: tuple[int, int],
        division: Division | None,
        panels: np.ndarray | None,
    ) -> np.ndarray:
        """The picture of a prepared frame, (height, width, 3), with the picture of the panels in their part."""
        part = size if division is None else division.scene
        renderer = self._renderer
        renderer.resize(part)
        renderer.camera = camera
        with seeing(camera, self.factor(part)):
            picture = renderer.picture_of(frame, trails or Trails(0))
        if division is not None and panels is not None:
            whole = np.zeros((size[1], size[0], 3), np.uint8)
            whole[: part[1], : part[0]] = picture
            whole[division.corner[1] :, division.corner[0] :] = panels
            picture = whole
        if self.spec.caption:
            draw_caption(picture, frame, self.spec.background)
        return picture
