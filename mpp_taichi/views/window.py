"""The interactive window: a GGUI window, our orbit camera, and a simulation driven frame by frame.

Needed: Vulkan (Mesa's lavapipe, in software, will do) and a display; any backend may compute, the CPU included.
Linux without a display, CI for one, can have one in memory: `xvfb-run python -m mpp_taichi …`.
"""

import atexit
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Protocol

import taichi as ti

from mpp_taichi.errors import BackendError, OutputError
from mpp_taichi.scene.spec import RecordSpec, ViewSpec
from mpp_taichi.views._base import Frame, Trails
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import caption_lines, draw_caption
from mpp_taichi.views.controls import HELP, Controls
from mpp_taichi.views.ggui import GguiScene, probe, read_back
from mpp_taichi.views.legend import draw_legend, legend_lines
from mpp_taichi.views.picture import save_picture
from mpp_taichi.views.window_panels import WindowPanels

FRAMES_PER_SECOND = 60
SLOW_SECONDS = 0.08  # an advance that takes longer is halved, so that the window answers
QUICK_SECONDS = 0.02  # one that takes less is doubled again, up to what was asked for
RATE_SECONDS = 0.5  # over which steps per second are counted
MESSAGE_SECONDS = 3.0
DEFAULT_TRAIL = 60  # frames, when T asks for trails that the scene did not
CAPTION_COLUMNS, CAPTION_ROWS = 36, 5  # GGUI never resizes a panel once it is there
LEGEND_COLUMNS = 44
HELD_KEYS = ("LMB", "MMB", "RMB", "Shift", "Control", "i", "o")


class Steerable(Protocol):
    """What the window needs of a simulation."""

    @property
    def finished(self) -> bool:
        """Whether the run has reached its end; single steps may still go on."""

    def advance(self, steps: int) -> None:
        """Go on by so many steps."""

    def frame(self) -> Frame:
        """What there is to see now."""

    def restart(self) -> None:
        """Go back to the start."""


def _keep_folder_clean() -> None:
    """Let the panel library behind GGUI leave its layout file, which it writes as the process ends, among temporary files."""
    layout = Path("imgui.ini").absolute()

    def leave() -> None:
        layout.unlink(missing_ok=True)
        os.chdir(tempfile.gettempdir())

    if not layout.exists():
        atexit.register(leave)


class Window:
    """Shows a simulation until the user closes it."""

    def __init__(
        self,
        spec: ViewSpec,
        size: tuple[int, int] = (1280, 720),
        *,
        title: str = "",
        dimensions: int = 3,
        panels: WindowPanels | None = None,
    ) -> None:
        """Open the window, with panels beside the scene where there are some; `ti.init` has been called.

        Raises:
            BackendError: there is no display, or GGUI does not work on it.
        """
        problem = probe(shown=True)
        if problem:
            raise BackendError(f"cannot open a window: {problem}")
        self.spec, self.dimensions, self.title = spec, dimensions, title
        self._panels = panels or WindowPanels((), RecordSpec(), str)
        _keep_folder_clean()
        self._window = ti.ui.Window(title or "mpp_taichi", size, vsync=False, fps_limit=FRAMES_PER_SECOND)
        self._scene = GguiScene(self._window, spec, dimensions=dimensions)
        self._trails = Trails(spec.trails or DEFAULT_TRAIL)
        self._message, self._message_end = "", 0.0

    def run(self, simulation: Steerable, *, steps_per_frame: int = 1, paused: bool = False) -> None:
        """Drive the simulation until the window is closed; `steps_per_frame` is halved while steps are slow."""
        controls = Controls(running=not paused, trails=self.spec.trails > 0)
        frame = self._look(simulation)
        camera = Camera(self.spec.camera, frame, aspect=self._aspect(), dimensions=self.dimensions)
        stride, rate, last = steps_per_frame, _Rate(), time.perf_counter()
        try:
            while self._window.running and not controls.quit:
                now = time.perf_counter()
                self._read_input(controls, camera, frame, now - last)
                last = now
                if controls.take("restart"):
                    simulation.restart()
                    self._trails.clear()
                    frame = self._look(simulation)
                going = controls.running and not simulation.finished
                steps = controls.take_steps() or (stride if going else 0)
                if steps > 0:
                    started = time.perf_counter()
                    simulation.advance(steps)
                    frame = self._look(simulation)
                    taken = time.perf_counter() - started
                    if taken > SLOW_SECONDS:
                        stride = max(stride // 2, 1)
                    elif taken < QUICK_SECONDS:
                        stride = min(stride * 2, steps_per_frame)
                self._show(frame, camera, controls, simulation.finished, rate.count(steps))
        finally:
            self._window.destroy()

    def _look(self, simulation: Steerable) -> Frame:
        """What there is to see, as the scene wants it drawn."""
        return self._scene.appearance.dress(simulation.frame())

    def _scene_share(self) -> float:
        """The share of the window's height that the scene has, above panels below it."""
        size = self._window.get_window_shape()
        division = self._panels.division(size)
        return 1.0 if division is None else float(division.scene[1] / size[1])

    def _aspect(self) -> float:
        return self._panels.aspect(self._window.get_window_shape(), self.spec.camera)

    def _read_input(self, controls: Controls, camera: Camera, frame: Frame, seconds: float) -> None:
        held = {key for key in HELD_KEYS if self._window.is_pressed(key)}
        keys = [event.key for event in self._window.get_events(ti.ui.PRESS)]
        shift = "Shift" in held or "Shift" in keys  # a key may come and go between two frames
        for key in keys:
            controls.press(key, shift=shift, camera=camera, frame=frame, aspect=self._aspect())
        size = self._window.get_window_shape()
        with self._panels.aside(camera, self.spec.camera, size):
            controls.move(self._window.get_cursor_pos(), held, camera=camera, seconds=seconds, aspect=size[0] / size[1])

    def _show(self, frame: Frame, camera: Camera, controls: Controls, finished: bool, rate: float) -> None:
        self._trails.add(frame)
        if controls.take("panels"):
            self._panels.toggle()
        self._draw(frame, camera, controls.trails)
        if controls.take("screenshot"):
            self._save(frame)
            self._draw(frame, camera, controls.trails)  # reading back used up what was drawn
        if controls.take("export"):
            self._say(self._panels.export())
        if controls.take("print_camera"):
            sys.stderr.write(camera.as_yaml())
            self._say("camera printed")
        status = "finished" if finished else "running" if controls.running else "paused"
        self._write([*caption_lines(frame), f"{status}, {rate:,.0f} steps/s   H: help", self._current_message()], controls.help)
        self._window.show()

    def _draw(self, frame: Frame, camera: Camera, with_trails: bool) -> None:
        size = self._window.get_window_shape()
        with self._panels.aside(camera, self.spec.camera, size) as self._scene.shift:
            self._scene.draw(frame, camera, self._trails if with_trails else None)
        self._panels.draw(self._window.get_canvas(), size, self._window.get_cursor_pos())

    def _save(self, frame: Frame) -> None:
        """Write the picture, without the panels, into the working directory, under the first number that is free."""
        path = next(path for number in range(10**6) if not (path := Path(f"screenshot_{number:04d}.png")).exists())
        picture = read_back(self._window)
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
        width, height = self._window.get_window_shape()
        gui = self._window.get_gui()
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
            columns, rows = 48, len(HELP)
            left = 1.0 - (7 * columns + 32) / width
            with gui.sub_window("keys", left, 8 / height, (7 * columns + 24) / width, (17 * rows + 32) / height) as panel:
                for keys, does in HELP:
                    panel.text(f"{keys:24s}{does}")

    def _say(self, message: str) -> None:
        self._message, self._message_end = message, time.perf_counter() + MESSAGE_SECONDS

    def _current_message(self) -> str:
        return self._message if time.perf_counter() < self._message_end else ""


class _Rate:
    """Steps per second over the last half second."""

    def __init__(self) -> None:
        self._since, self._steps, self._rate = time.perf_counter(), 0, 0.0

    def count(self, steps: int) -> float:
        """Add steps, and say how many there are in a second."""
        self._steps += steps
        passed = time.perf_counter() - self._since
        if passed >= RATE_SECONDS:
            self._rate = self._steps / passed
            self._since, self._steps = time.perf_counter(), 0
        return self._rate
