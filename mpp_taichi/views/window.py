"""The interactive window: a GGUI window, the program's orbit camera, and a simulation driven frame by frame.

The window needs Vulkan (Mesa's lavapipe, in software, is enough) and a display; any backend may compute, the CPU included.
Linux without a display can have a display in memory: `xvfb-run python -m mpp_taichi …`.
"""

import sys
import time
from collections.abc import Container
from contextlib import nullcontext
from typing import Protocol

import numpy as np

from mpp_taichi.errors import BackendError, OutputError
from mpp_taichi.scene.spec import RecordSpec, ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import caption_lines, draw_caption
from mpp_taichi.views.controls import Controls
from mpp_taichi.views.desk import Desk
from mpp_taichi.views.display_loss import DisplayLoss
from mpp_taichi.views.following import Follower
from mpp_taichi.views.ggui_probe import probe
from mpp_taichi.views.glass import Glass
from mpp_taichi.views.legend import draw_legend, legend_lines
from mpp_taichi.views.method_box import MethodBox
from mpp_taichi.views.numbered import numbered
from mpp_taichi.views.pace import Pace, Rate
from mpp_taichi.views.paper import GROUND, Mouse
from mpp_taichi.views.picking import described
from mpp_taichi.views.picture import save_picture
from mpp_taichi.views.scene_list import SceneList
from mpp_taichi.views.slider_panel import SliderPanel
from mpp_taichi.views.waiting import WORD, waiting_picture
from mpp_taichi.views.window_boxes import WindowBoxes
from mpp_taichi.views.window_film import WindowFilm
from mpp_taichi.views.window_input import WindowInput
from mpp_taichi.views.window_layout import Layout
from mpp_taichi.views.window_panels import WindowPanels
from mpp_taichi.views.window_scene import WindowScene
from mpp_taichi.views.window_settings import KeptChanges, WindowSettings

MESSAGE_SECONDS = 3.0


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
        look: str | None = None,
        settings: WindowSettings | None = None,
        decided: Container[str] = (),
    ) -> None:
        """Open the window, with panels beside the scene and sliders where there are some; `ti.init` has been called.

        With the `glass` of another Window, the window keeps its place and its size. `loss` answers the loss of the display;
        without it the process ends as Xlib and Taichi end it. `look` is one of LOOKS.
        A setting that is neither `look` nor among the `decided` settings is taken from the `settings` of the last window,
        which are given the changes that the user makes.

        Raises:
            BackendError: there is no display, or GGUI does not work on it.
        """
        problem = "" if glass is not None else probe(shown=True)
        if problem:
            raise BackendError(f"cannot open a window: {problem}")
        self.spec, self.dimensions, self.title = spec, dimensions, title
        settings = settings or WindowSettings()
        self._kept = KeptChanges(settings, decided, look_decided=look is not None)
        guard = nullcontext if loss is None else loss.in_glass
        if glass is None:
            if loss is not None:
                with guard():
                    loss.require_display()
            glass = Glass(title or "mpp_taichi", settings.size or size, guard, settings.place)
        glass.guard, glass.title = guard, title or glass.title
        self.glass = glass
        self.handed_on = False
        self._wait_for(title)
        self._panels = panels or WindowPanels((), RecordSpec(), str)
        self._panels.begin(self._kept.begin("panels"))
        self._scene = WindowScene(glass, spec, dimensions, self._panels, look or self._kept.begin("look") or "auto")
        self._desk = desk or Desk()
        self._sliders = SliderPanel(self._desk.knobs)
        self._scenes = SceneList(self._desk.place, self._desk.present, self._desk.title_of)
        self._method = MethodBox(self._desk.methods)
        self._boxes = WindowBoxes(self._sliders, self._scenes, self._method)
        self._input = WindowInput(glass, self._scene, self._boxes)
        self._follower = Follower()
        self._film = WindowFilm(self._desk.film)
        self._message, self._message_end = "", 0.0
        self._mouse = Mouse()
        self._layout = Layout.of(glass.size, boxes=self._sliders.shown)

    def run(self, simulation: Steerable, *, steps_per_frame: float = 1.0, paused: bool = False) -> None:
        """Drive the simulation until the window is closed: so many steps in a 60th of a second, fewer while steps are slow."""
        trails = self._kept.begin("trails")
        controls = Controls(running=not paused, trails=self.spec.trails > 0 if trails is None else trails)
        frame = self._look(simulation)
        self._layout = self._layout_of(frame, controls)
        aspect = self._scene.aspect(self._layout.picture)
        camera = Camera(self.spec.camera, frame, aspect=aspect, dimensions=self.dimensions)
        if self.dimensions == 2 and not camera.orthographic:
            camera.turn_projection()
        pace, rate, last = Pace(steps_per_frame, self._kept.begin("speed") or 0), Rate(), time.perf_counter()
        compiled = False  # the first picture is shown before the step is compiled
        try:
            while self.glass.running and not controls.quit:
                now = time.perf_counter()
                self._layout = self._layout_of(frame, controls)
                passed, last = now - last, now
                self._read_input(controls, camera, frame, passed)
                pace.change(controls.take_faster())
                if controls.take("restart"):
                    simulation.restart()
                    self._scene.trails.clear()
                    frame = self._look(simulation)
                if back := controls.take_steps_back():
                    frame = self._go_back(simulation, back)
                going = controls.running and not simulation.finished
                steps, before = controls.take_steps(), frame.time
                if not steps and going and compiled:
                    steps = pace.take(passed)
                if steps > 0:
                    started = time.perf_counter()
                    simulation.advance(steps)
                    frame = self._look(simulation)
                    pace.took(time.perf_counter() - started)
                self._follower.update(camera, frame)
                rate.count(steps, frame.time - before if steps else 0.0)
                told = rate.text(pace, frame.units) if compiled or not going else WORD
                self._show(frame, camera, controls, simulation.finished, told, passed)
                self._kept.see(self._settings_now(frame, controls, pace))
                compiled = True
        finally:
            self._film.end()
            if not self.handed_on:
                self.glass.destroy()

    def _settings_now(self, frame: Frame, controls: Controls, pace: Pace) -> WindowSettings:
        panels = self._panels.shown if self._panels.plots else None
        return WindowSettings(
            self._scene.look_beside(frame), self.glass.size, self.glass.place, panels, controls.trails, pace.speed
        )

    def _layout_of(self, frame: Frame, controls: Controls) -> Layout:
        shown = (self._sliders.shown, self._scenes.shown, self._method.shown, controls.help)
        return Layout.of(self.glass.size, boxes=any(shown) or not self._scene.has_film_look(frame))

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

    def _read_input(self, controls: Controls, camera: Camera, frame: Frame, seconds: float) -> None:
        self._mouse = self._input.read(controls, camera, frame, self._layout.picture, seconds)
        if controls.take("follow"):
            self._say(self._follower.next(self._scene.picked.index))
        if controls.take("whole_screen"):
            self._say(self.glass.toggle_full_screen())
        if controls.take("look"):
            self._say(self._scene.toggle_look(frame))

    def _show(self, frame: Frame, camera: Camera, controls: Controls, finished: bool, rate: str, seconds: float) -> None:
        scene = self._scene
        scene.trails.add(scene.appearance.with_drawn_velocity(frame))
        if controls.take("panels"):
            self._panels.toggle()
        if controls.take("sliders"):
            self._sliders.toggle()
        if controls.take("screenshot"):
            self._save(frame, camera, controls.trails)
        if controls.take("export"):
            self._say(self._panels.export())
        for request, action in (("save", self._desk.save), ("log", self._desk.log)):
            if controls.take(request):
                self._say(action())
        if controls.take("print_camera"):
            sys.stderr.write(camera.as_yaml())
            self._say("camera printed")
        self._layout = self._layout_of(frame, controls)
        picture = scene.draw(frame, camera, self._layout.picture, trails=controls.trails)
        if controls.take("film"):
            self._say(self._film.toggle(picture))
        elif message := self._film.add(picture, seconds):
            self._say(message)
        status = "finished" if finished else "running" if controls.running else "paused"
        told = scene.trails.message if controls.trails else ""
        line = f"{status}, {rate}   H: help" + ("   D: plain spheres" if picture is None else "")
        self._put_boxes(frame, controls, [line, self._current_message() or told, self._method.told()], picture is None)
        if picture is None:
            self._boxes.draw(self.glass)
        else:
            self.glass.put(self._composed(picture))
        self.glass.show()
        moved = self._input.moved | self._boxes.moved
        if moved and (message := self._desk.move(moved)):
            self._say(message)
        self._open_scene(controls)

    def _put_boxes(self, frame: Frame, controls: Controls, status: list[str], plain: bool) -> None:
        """Lay out the boxes; where GGUI draws the scene, they hold its caption and its legend as well."""
        index = self._scene.picked.index
        shown = index is not None and index < len(self._bare.position)
        self._boxes.begin()
        self._boxes.put(
            self._layout,
            self._mouse,
            running=controls.running,
            filming=self._film.on,
            look="plain spheres" if plain else "as in films",
            status=status,
            caption=caption_lines(frame) if plain and self.spec.caption else (),
            legend=legend_lines(self._scene.appearance.legend()) if plain else (),
            picked=described(self._bare, index) if index is not None and shown else (),
            with_help=controls.help,
        )
        self._boxes.end()

    def _composed(self, picture: np.ndarray) -> np.ndarray:
        """The whole window: the picture and the boxes."""
        area, (width, height) = self._layout.picture, self.glass.size
        whole = np.full((height, width, 3), GROUND, np.uint8)
        whole[area.top : area.top + area.height, area.left : area.left + area.width] = picture
        self._boxes.paste(whole)
        return whole

    def _save(self, frame: Frame, camera: Camera, with_trails: bool) -> None:
        """Write the picture, without the boxes, into the folder of outputs."""
        (path,) = numbered("screenshot", ".png")
        picture = self._scene.draw(frame, camera, self._layout.picture, trails=with_trails, marked=False)
        if picture is None:
            area, part = self._layout.picture, self._scene.part(self._layout.picture)
            picture = self.glass.read_back()[: area.height, area.left :].copy()
            if self.spec.caption:
                draw_caption(picture, frame, self.spec.background)
            draw_legend(picture[: part.height, : part.width], self._scene.appearance.legend(), self.spec.background)
        try:
            save_picture(picture, path)
            self._say(f"saved {path}")
        except OutputError as error:
            self._say(str(error))

    def _open_scene(self, controls: Controls) -> None:
        """Hand the window on to the scene or the integrator that was chosen from a list, if it can be begun."""
        if (file := self._scenes.take()) is not None:
            self._wait_for(self._desk.title_of(file) or file.name)
            self._scenes.message = self._desk.open(file)
            self.handed_on = controls.quit = not self._scenes.message
        elif (method := self._method.take()) is not None and self._desk.methods is not None:
            self._wait_for(self.title)
            self._method.message = self._desk.methods.choose(*method)
            self.handed_on = controls.quit = not self._method.message

    def _say(self, message: str) -> None:
        self._message, self._message_end = message, time.perf_counter() + MESSAGE_SECONDS

    def _current_message(self) -> str:
        return self._message if time.perf_counter() < self._message_end else ""
