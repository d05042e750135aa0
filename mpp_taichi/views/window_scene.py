"""The scene in a window: as films show it, or by GGUI's spheres and lines."""

import numpy as np
from PIL import Image, ImageDraw

from mpp_taichi.scene.spec import ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.few_trails import FewTrails
from mpp_taichi.views.film_look import FilmLook, seeing
from mpp_taichi.views.ggui import GguiScene
from mpp_taichi.views.glass import Glass
from mpp_taichi.views.looks import is_film
from mpp_taichi.views.overlay import has_overlay, overlay_layer
from mpp_taichi.views.picking import CLEARANCE, discs, pick
from mpp_taichi.views.pixel_points import PixelPoints
from mpp_taichi.views.window_layout import Area
from mpp_taichi.views.window_mark import COLOR, WindowMark
from mpp_taichi.views.window_panels import WindowPanels

DEFAULT_TRAIL = 60  # frames, when T switches on trails that the scene does not have


class WindowScene:
    """Draws frames into an area of a window; `look` is one of LOOKS."""

    def __init__(self, glass: Glass, spec: ViewSpec, dimensions: int, panels: WindowPanels, look: str) -> None:
        """Nothing is drawn yet."""
        self.glass, self.spec, self.panels, self.look = glass, spec, panels, look
        self.ggui = GguiScene(glass.window, spec, dimensions=dimensions)
        self.appearance = self.ggui.appearance
        self.film = FilmLook(spec, dimensions, self.appearance, panels.record.size)
        self.trails = FewTrails(spec.trails or DEFAULT_TRAIL, everything=spec.trails > 0)
        self.picked = WindowMark()
        self._names = PixelPoints()

    def has_film_look(self, frame: Frame) -> bool:
        """Whether a frame has the look of films."""
        return is_film(self.look, len(frame.position))

    def look_beside(self, frame: Frame) -> str:
        """The look, `auto` where it is the one that a frame has unasked."""
        film = self.has_film_look(frame)
        return "auto" if film == is_film("auto", len(frame.position)) else "film" if film else "plain"

    def toggle_look(self, frame: Frame) -> str:
        """Change to the other look; returns a line that names it."""
        self.look = "plain" if self.has_film_look(frame) else "film"
        return "the look of films" if self.look == "film" else "plain spheres, drawn by GGUI"

    def part(self, area: Area) -> Area:
        """The part of the area that the scene has beside the panels."""
        division = self.panels.division(area.size)
        return area if division is None else area.part(division.scene)

    def aspect(self, area: Area) -> float:
        """Width over height of the picture for which a camera chooses its place."""
        part = self.part(area)
        width, height = self.film.film_size if self.film.factor(part.size) > 1.0 else part.size
        return width / height

    def found(self, frame: Frame, camera: Camera, area: Area, pixel: tuple[float, float]) -> int | None:
        """The particle at a pixel of the window, or None."""
        part = self.part(area)
        with seeing(camera, self.film.factor(part.size)):
            drawn = discs(frame, camera, self.spec, part.size)
        return pick(drawn, part.share(pixel), part.size)

    def draw(self, frame: Frame, camera: Camera, area: Area, *, trails: bool, marked: bool = True) -> np.ndarray | None:
        """The picture of the area, (height, width, 3); None where GGUI has drawn the scene on the canvas of the window."""
        size = self.glass.size
        cursor = self.glass.cursor[0] * size[0] - area.left, (1.0 - self.glass.cursor[1]) * size[1] - area.top
        sheet = self.panels.picture(area.size, cursor)
        if not self.has_film_look(frame):
            self._draw_plain(frame, camera, area, self.trails if trails else None)
            if sheet is not None:
                self.panels.draw(self.glass, area, sheet)
            return None
        division = self.panels.division(area.size)
        picture = self.film.picture(frame, camera, self.trails if trails else None, area.size, division, sheet)
        return self._with_mark(picture, frame, camera, area) if marked and self.picked.index is not None else picture

    def _with_mark(self, picture: np.ndarray, frame: Frame, camera: Camera, area: Area) -> np.ndarray:
        """The picture with a ring around the particle that is picked."""
        part, index = self.part(area), self.picked.index
        with seeing(camera, self.film.factor(part.size)):
            drawn = discs(frame, camera, self.spec, part.size)
        if index is None or index >= len(drawn.depth) or not np.isfinite(drawn.middle[index]).all():
            return picture
        image, (x, y) = Image.fromarray(picture), drawn.middle[index]
        reach = min(float(drawn.radius[index]), float(sum(part.size))) + CLEARANCE
        row = part.height - y
        color = tuple(round(255.0 * share) for share in COLOR)
        ImageDraw.Draw(image).ellipse([x - reach, row - reach, x + reach, row + reach], outline=color, width=2)
        return np.asarray(image)

    def _draw_plain(self, frame: Frame, camera: Camera, area: Area, trails: FewTrails | None) -> None:
        part, (width, height) = self.part(area), self.glass.size
        # The camera's picture for the part is extended to the whole window, in which the part's middle is not the middle.
        self.ggui.shift = (2 * part.left + part.width - width) / height, (height - 2 * part.top - part.height) / height
        with seeing(camera, self.film.factor(part.size) * height / part.height):
            self.ggui.draw(frame, camera, trails)
            if self.picked.index is not None:
                drawn = discs(frame, camera, self.spec, (width, height), self.ggui.shift)
                self.picked.draw(self.glass.canvas, drawn, (width, height))
            if has_overlay(self.spec):
                inside = part.left + part.width, part.top + part.height
                self._names.put(
                    *overlay_layer(frame, self.spec, camera, (width, height), self.ggui.shift, inside), (width, height)
                )
                self._names.draw(self.glass.canvas, (width, height))
