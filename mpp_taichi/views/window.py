"""The interactive window: a GGUI window, the program's orbit camera, and a simulation driven frame by frame.

The window needs Vulkan (Mesa's lavapipe, in software, is enough) and a display; any backend may compute, the CPU included.
Linux without a display can have a display in memory: `xvfb-run python -m mpp_taichi …`.
"""

import sys
import time
from contextlib import nullcontext
from typing import Protocol

from mpp_taichi.errors import BackendError, OutputError
from mpp_taichi.scene.spec import RecordSpec, ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import caption_lines, draw_caption
from mpp_taichi.views.controls import BUTTONS, HELP, ZOOM_PER_CLICK, Controls, holds
from mpp_taichi.views.desk import Desk
from mpp_taichi.views.display_loss import DisplayLoss
from mpp_taichi.views.following import Follower
from mpp_taichi.views.ggui import GguiScene, probe
from mpp_taichi.views.glass import Glass
from mpp_taichi.views.legend import draw_legend, legend_lines
from mpp_taichi.views.numbered import numbered
from mpp_taichi.views.overlay import has_overlay, overlay_layer
from mpp_taichi.views.pace import Pace, Rate
from mpp_taichi.views.picking import discs, pick
from mpp_taichi.views.picture import save_picture
from mpp_taichi.views.pixel_points import PixelPoints
from mpp_taichi.views.scene_list import SceneList
from mpp_taichi.views.slider_panel import SliderPanel
from mpp_taichi.views.trails import Trails
from mpp_taichi.views.waiting import WORD, waiting_picture
from mpp_taichi.views.window_mark import WindowMark
from mpp_taichi.views.window_panels import WindowPanels

MESSAGE_SECONDS = 3.0
DEFAULT_TRAIL = 60  # frames, when T switches on trails that the scene does not have
CAPTION_COLUMNS, CAPTION_ROWS = 36, 5  # GGUI never resizes a panel after its first frame
LEGEND_COLUMNS = 44
HELD_KEYS = ("LMB", "MMB", "RMB", "Shift", "Control", "i", "o")


class Steerable(Protocol):
    """The functions of a simulation that the window uses."""

    @property
    def finished(self) -> bool:
        """Whether the run has reached its end; single steps may still go on."""

    def advance(self, steps: int) -> None:
        """Take the given number of steps."""

    def frame(self) -> Frame:
        """The present frame."""

    def restart(self) -> None:
        """Go back to the start."""


class Window:
    """Shows a simulation until the user closes it, or opens another scene.

    Then `handed_on` is true, and `glass`, the open window, is handed on to the Window of that scene.
    """

    def __init__(
        self,
        spec: ViewSpec,
        size: tuple[int, int] = (1280, 720),
        *,
        title: str = "",
        dimensions: int = 3,
        panels: WindowPanels | None = None,
        desk: Desk | None = None,
        glass: Glass | None = None,
        loss: DisplayLoss | None = None,
    ) -> None:
        """Open the window, with panels beside the scene and sliders where there are some; `ti.init` has been called.

        With the `glass` of another Window, the window keeps its place, its size and its name. `loss` answers the loss of the
        display; without it the process ends as Xlib and Taichi end it.

        Raises:
            BackendError: there is no display, or GGUI does not work on it.
        """
        problem = "" if glass is not None else probe(shown=True)
        if problem:
            raise BackendError(f"cannot open a window: {problem}")
        self.spec, self.dimensions, self.title = spec, dimensions, title
        guard = nullcontext if loss is None else loss.in_glass
        self._panels = panels or WindowPanels((), RecordSpec(), str)
        if glass is None:
            if loss is not None:
                with guard():
                    loss.require_display()
            glass = Glass(title or "mpp_taichi", size, guard)
        glass.guard, glass.title = guard, title or glass.title
        self.glass = glass
        self.handed_on = False
        self._wait_for(title)
        self._scene = GguiScene(glass.window, spec, dimensions=dimensions)
        self._trails = Trails(spec.trails or DEFAULT_TRAIL)
        self._desk = desk or Desk()
        self._sliders = SliderPanel(self._desk.knobs)
        self._scenes = SceneList(self._desk.scenes, self._desk.present)
        self._picked = WindowMark()
        self._names = PixelPoints()
        self._follower = Follower()
        self._message, self._message_end = "", 0.0

    def run(self, simulation: Steerable, *, steps_per_frame: int = 1, paused: bool = False) -> None:
        """Drive the simulation until the window is closed, with fewer steps per frame while steps are slow."""
        controls = Controls(running=not paused, trails=self.spec.trails > 0)
        frame = self._look(simulation)
        camera = Camera(self.spec.camera, frame, aspect=self._aspect(), dimensions=self.dimensions)
        if self.dimensions == 2 and not camera.orthographic:
            camera.turn_projection()
        pace, rate, last = Pace(steps_per_frame), Rate(), time.perf_counter()
        compiled = False  # the first picture is shown before the step is compiled
        try:
            while self.glass.running and not controls.quit:
                now = time.perf_counter()
                self._read_input(controls, camera, frame, now - last)
                last = now
                pace.change(controls.take_faster())
                if controls.take("restart"):
                    simulation.restart()
                    self._trails.clear()
                    frame = self._look(simulation)
                if back := controls.take_steps_back():
                    frame = self._go_back(simulation, back)
                going = controls.running and not simulation.finished
                steps = controls.take_steps() or (pace.take() if going and compiled else 0)
                if steps > 0:
                    started = time.perf_counter()
                    simulation.advance(steps)
                    frame = self._look(simulation)
                    pace.took(time.perf_counter() - started)
                self._follower.update(camera, frame)
                told = f"{rate.count(steps):,.0f} steps/s{pace.text}" if compiled or not going else WORD
                self._show(frame, camera, controls, simulation.finished, told)
                compiled = True
        finally:
            if not self.handed_on:
                self.glass.destroy()

    def _wait_for(self, title: str) -> None:
        """Show the title of a scene that is being compiled."""
        self.glass.put(waiting_picture(title, self.glass.size, self.spec.background))
        self.glass.show()

    def _go_back(self, simulation: Steerable, times: int) -> Frame:
        """Go back by the given number of frames, or by as many as are kept."""
        if not any([self._desk.back() for _ in range(times)]):
            self._say("there is no way back from here")
        return self._look(simulation)

    def _look(self, simulation: Steerable) -> Frame:
        """The present frame, prepared as the scene asks."""
        self._bare = simulation.frame()
        return self._scene.appearance.dress(self._bare)

    def _scene_share(self) -> float:
        """The scene's share of the window's height, where panels are below the scene."""
        size = self.glass.size
        division = self._panels.division(size)
        return 1.0 if division is None else float(division.scene[1] / size[1])

    def _aspect(self) -> float:
        return self._panels.aspect(self.glass.size, self.spec.camera)

    def _read_input(self, controls: Controls, camera: Camera, frame: Frame, seconds: float) -> None:
        keys = self.glass.pressed()
        held = self.glass.held(HELD_KEYS)
        held |= BUTTONS & set(keys)  # a click may begin and end between two frames
        shift = "Shift" in held or "Shift" in keys  # a key may go down and up between two frames
        for key in keys:
            if not self._scenes.press(key):
                controls.press(key, shift=shift, camera=camera, frame=frame, aspect=self._aspect())
            if controls.take("scenes"):  # at once: the next keys of the same frame are for the list
                self._scenes.toggle()
        size = self.glass.size
        sliders = [self._sliders.box(size, self._caption_bottom())] if self._sliders.shown else []
        controls.occupied = [*sliders, *([self._scenes.box(size)] if self._scenes.shown else [])]
        with self._panels.aside(camera, self.spec.camera, size) as away:
            controls.move(self.glass.cursor, held, camera=camera, seconds=seconds, aspect=size[0] / size[1])
            if (cursor := controls.take_click()) is not None:
                self._picked.index = pick(discs(frame, camera, self.spec, size, away), cursor, size)
        if (clicks := self.glass.take_wheel()) and not any(holds(box, self.glass.cursor) for box in controls.occupied):
            camera.zoom(ZOOM_PER_CLICK**clicks)
        if controls.take("follow"):
            self._say(self._follower.next(self._picked.index))

    def _show(self, frame: Frame, camera: Camera, controls: Controls, finished: bool, rate: str) -> None:
        self._trails.add(self._scene.appearance.with_drawn_velocity(frame))
        if controls.take("panels"):
            self._panels.toggle()
        self._draw(frame, camera, controls.trails)
        if controls.take("screenshot"):
            self._save(frame)
            self._draw(frame, camera, controls.trails)  # reading back empties the canvas
        if controls.take("export"):
            self._say(self._panels.export())
        for request, action in (("save", self._desk.save), ("log", self._desk.log)):
            if controls.take(request):
                self._say(action())
        if controls.take("sliders"):
            self._sliders.toggle()
        if controls.take("print_camera"):
            sys.stderr.write(camera.as_yaml())
            self._say("camera printed")
        status = "finished" if finished else "running" if controls.running else "paused"
        self._write(
            [*caption_lines(frame), f"{status}, {rate}   H: help", self._current_message()],
            controls.help and not self._scenes.shown,
        )
        legend = legend_lines(self._scene.appearance.legend())
        self._picked.write(self.glass.window, self._bare, 7 * LEGEND_COLUMNS + 40 if legend else 8)
        if self._sliders.shown:
            self._move_sliders()
        if self._scenes.shown:
            self._list_scenes(controls)
        self.glass.show()

    def _draw(self, frame: Frame, camera: Camera, with_trails: bool) -> None:
        size = self.glass.size
        with self._panels.aside(camera, self.spec.camera, size) as self._scene.shift:
            self._scene.draw(frame, camera, self._trails if with_trails else None)
            if self._picked.index is not None:
                self._picked.draw(self.glass.canvas, discs(frame, camera, self.spec, size, self._scene.shift), size)
            if has_overlay(self.spec):
                division = self._panels.division(size)
                part = size if division is None else division.scene
                self._names.put(*overlay_layer(frame, self.spec, camera, size, self._scene.shift, part), size)
                self._names.draw(self.glass.canvas, size)
        self._panels.draw(self.glass.canvas, size, self.glass.cursor)

    def _save(self, frame: Frame) -> None:
        """Write the picture, without the panels."""
        (path,) = numbered("screenshot", ".png")
        picture = self.glass.read_back()
        if self.spec.caption:
            draw_caption(picture, frame, self.spec.background)
        rows = round(self._scene_share() * len(picture))
        draw_legend(picture[:rows], self._scene.appearance.legend(), self.spec.background)
        try:
            save_picture(picture, path)
            self._say(f"saved {path}")
        except OutputError as error:
            self._say(str(error))

    def _write(self, lines: list[str], with_help: bool) -> None:
        """Text over the picture. GGUI's font is 13 pixels high and knows Latin-1 only."""
        width, height = self.glass.size
        gui = self.glass.window.get_gui()
        if self.spec.caption:
            columns = max(CAPTION_COLUMNS, *(len(line) for line in lines))
            with gui.sub_window(
                "scene", 8 / width, 8 / height, (7 * columns + 24) / width, (17 * CAPTION_ROWS + 32) / height
            ) as panel:
                for line in lines:
                    panel.text(line)
        if legend := legend_lines(self._scene.appearance.legend()):
            columns, deep = max(LEGEND_COLUMNS, *(len(line) for line in legend)), (17 * len(legend) + 32) / height
            top = self._scene_share() - 8 / height - deep
            with gui.sub_window("legend", 8 / width, top, (7 * columns + 24) / width, deep) as panel:
                for line in legend:
                    panel.text(line)
        if with_help:
            columns, rows = 60, len(HELP)
            left = 1.0 - (7 * columns + 32) / width
            with gui.sub_window("keys", left, 8 / height, (7 * columns + 24) / width, (17 * rows + 32) / height) as panel:
                for keys, does in HELP:
                    panel.text(f"{keys:29s}{does}")

    def _caption_bottom(self) -> int:
        """Height of the caption in pixels, at most."""
        return 17 * CAPTION_ROWS + 48 if self.spec.caption else 8

    def _move_sliders(self) -> None:
        """Draw the sliders, and set the moved parameters; the next step uses them."""
        size = self.glass.size
        gui = self.glass.window.get_gui()
        with gui.sub_window("sliders", *self._sliders.box(size, self._caption_bottom())) as panel:
            moved = self._sliders.draw(panel)
        if moved and (message := self._desk.move(moved)):
            self._say(message)

    def _list_scenes(self, controls: Controls) -> None:
        """Draw the list of scenes, and hand the window on to the chosen scene if it can be opened."""
        size = self.glass.size
        # The number of rows is part of the name by which GGUI identifies the panel, since GGUI never resizes a panel.
        rows = self._scenes.rows(size[1])
        with self.glass.window.get_gui().sub_window(f"scenes###{rows}", *self._scenes.box(size)) as panel:
            self._scenes.draw(panel, size[1])
        if (name := self._scenes.take()) is not None:
            self._wait_for(self._desk.title_of(name))
            self._scenes.message = self._desk.open(name)
            self.handed_on = controls.quit = not self._scenes.message

    def _say(self, message: str) -> None:
        self._message, self._message_end = message, time.perf_counter() + MESSAGE_SECONDS

    def _current_message(self) -> str:
        return self._message if time.perf_counter() < self._message_end else ""
