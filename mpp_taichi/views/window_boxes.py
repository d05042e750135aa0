"""The boxes of a window: status, help, sliders, the list of scenes, and buttons; beside the picture where there is room."""

from collections.abc import Sequence

import numpy as np

from mpp_taichi.views.canvas_layer import CanvasLayer
from mpp_taichi.views.controls import HELP, LOOK_KEY
from mpp_taichi.views.glass import Glass
from mpp_taichi.views.method_box import MethodBox
from mpp_taichi.views.paper import LINE, RIM, ROW, Mouse, Paper
from mpp_taichi.views.scene_list import HEAD, SceneList
from mpp_taichi.views.slider_panel import SliderPanel
from mpp_taichi.views.window_layout import Area, Layout

BUTTONS = (
    ("step", "Right"),
    ("back", "Left"),
    ("restart", "BackSpace"),
    ("slower", "Down"),
    ("faster", "Up"),
    ("trails", "t"),
    ("scenes", "n"),
    ("method", "a"),
    ("picture", "c"),
    ("help", "h"),
)
"""Texts of buttons, and the keys that they stand for."""
ZOOMS = (("\N{MINUS SIGN}", 0.8), ("+", 1.25))
KEYS_WIDTH = 176  # pixels of the first column of the help
HELP_WIDTH, HELP_LINE, LEAST_LINE = 384, 17, 14
STATUS_WIDTH, STATUS_TOP = 268, 54  # of a small window: below the caption of the picture
SLIDERS_TOP = 133
BUTTON_WIDTH, ZOOM_WIDTH = 62, 26


class WindowBoxes:
    """Draws the boxes and tells what was pressed: keys, factors of the zoom, and moved parameters."""

    def __init__(self, sliders: SliderPanel, scenes: SceneList, method: MethodBox) -> None:
        """Nothing is drawn yet."""
        self.sliders, self.scenes, self.method = sliders, scenes, method
        self.keys: list[str] = []
        self.zoom = 1.0
        self.moved: dict[str, float] = {}
        self.areas: list[Area] = []
        self._look = ""
        self._papers: dict[str, Paper] = {}
        self._layers: dict[str, CanvasLayer] = {}
        self._found: dict[str, tuple[Area, Paper]] = {}

    def begin(self) -> None:
        """Begin a frame."""
        self.keys, self.zoom, self.moved, self._found = [], 1.0, {}, {}

    def end(self) -> None:
        """All boxes of a frame are there."""
        self.areas = [area for area, _ in self._found.values()]

    def _titled(self, name: str, area: Area, mouse: Mouse) -> Paper:
        paper = self._paper(name, area, mouse, 6)
        paper.text(name, faint=True)
        paper.begin_text(0, HEAD - 6)
        return paper

    def _paper(self, name: str, area: Area, mouse: Mouse, top: int = RIM) -> Paper:
        paper = self._papers.setdefault(name, Paper())
        area = Area(area.left, area.top, max(area.width, 1), max(area.height, 1))  # of a window that is tiny
        paper.begin(area.size, Mouse(area.inside(mouse.place), mouse.down, mouse.held), top)
        self._found[name] = area, paper
        return paper

    def put(
        self,
        layout: Layout,
        mouse: Mouse,
        *,
        running: bool,
        filming: bool,
        look: str,
        status: Sequence[str],
        caption: Sequence[str],
        legend: Sequence[str],
        picked: Sequence[str],
        with_help: bool,
    ) -> None:
        """Lay out all boxes; `mouse` is in pixels of the window. `caption` and `legend` are those that the picture lacks."""
        self._look = look
        if layout.strip is not None:
            below = [status[1] or "   ".join(picked), *status[2:]]
            self._strip(layout.strip, mouse, running, filming, status[0], "   ".join(line for line in below if line))
        if layout.column is not None:
            self._column(layout.column, mouse, caption, legend, with_help)
        elif layout.strip is None:
            self._over_the_picture(layout.size, mouse, status, caption, legend, picked, with_help)

    def _strip(self, area: Area, mouse: Mouse, running: bool, filming: bool, status: str, more: str) -> None:
        paper = self._paper("strip", area, mouse)
        left, top, bottom = RIM, 4, 4 + ROW
        for text, key in (("pause" if running else "run", " "), *BUTTONS, ("stop film" if filming else "film", "m")):
            if paper.button_at((left, top, left + BUTTON_WIDTH, bottom), text, middle=True):
                self.keys.append(key)
            left += BUTTON_WIDTH + 4
        for text, factor in ZOOMS:
            if paper.button_at((left, top, left + ZOOM_WIDTH, bottom), text, middle=True):
                self.zoom *= factor
            left += ZOOM_WIDTH + 4
        if area.width - left >= STATUS_WIDTH:
            paper.begin_text(left + RIM, top + 3)
            paper.text(status)
        else:
            more = f"{status}   {more}"
        paper.begin_text(0, bottom + 3)
        paper.text(more, faint=True)

    def _column(self, area: Area, mouse: Mouse, caption: Sequence[str], legend: Sequence[str], with_help: bool) -> None:
        paper = self._paper("column", area, mouse)
        for line in (*caption, *legend):
            paper.text(line)
        if (listed := self._listed()) is not None:
            paper.space(RIM)
            listed.draw(paper, area.height - paper.bottom + 16)
            return
        if self.sliders.shown:
            paper.space(RIM)
            self.moved = self.sliders.draw(paper)
        if with_help:
            paper.space(RIM)
            _write_help(paper, self._look, area.height)

    def _over_the_picture(
        self,
        size: tuple[int, int],
        mouse: Mouse,
        status: Sequence[str],
        caption: Sequence[str],
        legend: Sequence[str],
        picked: Sequence[str],
        with_help: bool,
    ) -> None:
        lines = [*caption, *(line for line in status if line)]
        top = RIM if caption else STATUS_TOP
        paper = self._paper("status", Area(RIM, top, STATUS_WIDTH, LINE * len(lines) + 12), mouse, 6)
        for line in lines:
            paper.text(line)
        if self.sliders.shown:
            area = _area(self.sliders.box(size, SLIDERS_TOP), size)
            paper = self._titled("sliders", area, mouse)
            self.moved = self.sliders.draw(paper)
        bottom = size[1] - RIM
        for name, texts in (("legend", legend), ("picked", picked)):
            if texts:
                high = LINE * len(texts) + 12
                paper = self._paper(name, Area(RIM, bottom - high, HELP_WIDTH, high), mouse, 6)
                for line in texts:
                    paper.text(line)
                bottom -= high + RIM
        if (listed := self._listed()) is not None:
            paper = self._titled("scenes" if listed is self.scenes else "method", _area(listed.box(size), size), mouse)
            listed.draw(paper, size[1])
        elif with_help:
            high = min(HELP_LINE * len(HELP) + 16, size[1] - 2 * RIM)
            paper = self._paper("help", Area(size[0] - HELP_WIDTH - RIM, RIM, HELP_WIDTH, high), mouse)
            _write_help(paper, self._look, high)

    def scroll(self, rows: int) -> None:
        """Move the mark of the list that is shown."""
        if (listed := self._listed()) is not None:
            listed.scroll(rows)

    def _listed(self) -> SceneList | MethodBox | None:
        """The list that is shown."""
        return self.scenes if self.scenes.shown else self.method if self.method.shown else None

    def paste(self, whole: np.ndarray) -> None:
        """Put the boxes into the picture of a window, in place."""
        for area, paper in self._found.values():
            left, top = max(area.left, 0), max(area.top, 0)
            right, bottom = min(area.left + area.width, whole.shape[1]), min(area.top + area.height, whole.shape[0])
            if left < right and top < bottom:
                inside = slice(top - area.top, bottom - area.top), slice(left - area.left, right - area.left)
                whole[top:bottom, left:right] = paper.picture()[inside]

    def draw(self, glass: Glass) -> None:
        """Put the boxes on the canvas of a window, over a scene that GGUI has drawn."""
        for name, (area, paper) in self._found.items():
            layer = self._layers.setdefault(name, CanvasLayer())
            layer.draw(glass.canvas, glass.size, (area.left, area.top), paper.picture(), paper.grounds())


def _write_help(paper: Paper, look: str, height: int) -> None:
    """Write the help into the rest of a box of this height, with lines that are nearer together where there is little room."""
    room = (height - paper.bottom) // len(HELP)
    for keys, does in HELP:
        told = f"look: {look}" if keys == LOOK_KEY else does
        paper.row((keys, told), (0, KEYS_WIDTH))
        paper.space(min(max(room, LEAST_LINE), LINE) - LINE)


def _area(box: tuple[float, float, float, float], size: tuple[int, int]) -> Area:
    left, top, width, height = box
    return Area(round(left * size[0]), round(top * size[1]), round(width * size[0]), round(height * size[1]))
