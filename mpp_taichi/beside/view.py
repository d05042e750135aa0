"""Two halves: pictures of two runs side by side, seen by one camera, with captions below each and plots below both."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from PIL import Image

from mpp_taichi.plots import Plot
from mpp_taichi.plots.lettering import lettering
from mpp_taichi.plots.sheet import Sheet, letters_for
from mpp_taichi.plots.theme import DARK
from mpp_taichi.scene.spec import ViewSpec
from mpp_taichi.views._base import Frame, View
from mpp_taichi.views.caption import draw_caption
from mpp_taichi.views.panels import LEAST, narrowed
from mpp_taichi.views.renderer import Renderer
from mpp_taichi.views.trails import Trails

GAP = 2  # pixels between the halves, at least
LEADING = 1.5  # heights of letters from one line to the next
ELLIPSIS = "…"


class TwoHalves(View):
    """Draws a frame into the left half of a picture and `other` into the right one."""

    def __init__(
        self,
        spec: ViewSpec,
        size: tuple[int, int],
        captions: tuple[Sequence[str], Sequence[str]],
        plots: Sequence[Plot] = (),
        *,
        share: float,
        dimensions: int = 3,
    ) -> None:
        """`captions` are the lines below the two halves; `plots`, if any, take a `share` of the height."""
        width, height = size
        letters = letters_for(height)
        lines = max(len(caption) for caption in captions)
        self._bottom = round(share * height) if plots else 0
        self._half = (width - GAP) // 2
        self._rows = max(LEAST, height - self._bottom - round(letters * (LEADING * lines + 0.5)))
        self._sheet = Sheet(plots, (width, self._bottom), letters) if plots else None
        self._caption = spec.caption
        plain = replace(narrowed(spec, size, (self._half, self._rows)), caption=False)
        self._renderer = Renderer(plain, (self._half, self._rows), dimensions=dimensions)
        self._trails = [Trails(spec.trails) for _ in captions]
        self._ground = self._written(size, captions, letters)
        self.other: Frame | None = None

    def draw(self, frame: Frame) -> np.ndarray:
        """The picture of both; a new array each time."""
        assert self.other is not None
        picture = self._ground.copy()
        self._renderer.see(self.other)
        corners = (0, picture.shape[1] - self._half)
        for half, trails, left in zip((frame, self.other), self._trails, corners):
            self._renderer.trails = trails
            picture[: self._rows, left : left + self._half] = self._renderer.draw(half)
        if self._sheet is not None:
            picture[len(picture) - self._bottom :] = self._sheet.picture()
        if self._caption:
            draw_caption(picture, frame, self._renderer.spec.background)
        return picture

    def close(self) -> None:
        """Close the renderer."""
        self._renderer.close()

    def _written(self, size: tuple[int, int], captions: tuple[Sequence[str], Sequence[str]], letters: int) -> np.ndarray:
        """The part that is the same in every picture: the captions, each in the middle below its half."""
        ground = Image.new("RGB", size, DARK.background)
        pen = lettering(letters)
        for caption, middle in zip(captions, (self._half / 2, size[0] - self._half / 2)):
            for number, line in enumerate(caption):
                text = shortened(line, lambda text: pen.width(text) <= self._half - letters)
                place = (middle, self._rows + letters * (LEADING * number + 0.25))
                pen.write(ground, place, text, DARK.text, anchor="ma")
        return np.asarray(ground)


def shortened(text: str, fits) -> str:
    """The text, or its beginning with an ellipsis, as long as it fits."""
    while len(text) > 1 and not fits(text):
        text = text.removesuffix(ELLIPSIS)[:-1] + ELLIPSIS
    return text
