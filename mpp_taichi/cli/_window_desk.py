"""The desk of a window on a run: its sliders, its history, its checkpoints and its log."""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from mpp_taichi import component
from mpp_taichi.cli._file_scene import FileScene, scene_in
from mpp_taichi.cli._methods import about, refusal, with_method
from mpp_taichi.cli._options import OUTPUT_FOLDER, output_stem
from mpp_taichi.cli._shelves import Folder
from mpp_taichi.cli._terminal import explain_error
from mpp_taichi.errors import MppError, OutputError
from mpp_taichi.recorders.inspection import InspectionRecorder
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.recorders.video import VideoRecorder
from mpp_taichi.report.summary import Timed
from mpp_taichi.scene.bundled import SUFFIXES as SCENE_FILES
from mpp_taichi.scene.log import reads_files, write_log
from mpp_taichi.scene.sliders import value_of
from mpp_taichi.scene.spec import SliderSpec
from mpp_taichi.simulation.history import History
from mpp_taichi.views.desk import Desk
from mpp_taichi.views.method_box import Methods
from mpp_taichi.views.numbered import numbered
from mpp_taichi.views.slider_panel import Knob

if TYPE_CHECKING:
    from mpp_taichi.cli._goal import Goal
    from mpp_taichi.cli._start_simulation import Started
    from mpp_taichi.simulation.simulation import Simulation

    class Starter(Protocol):
        """Starts the simulation of another scene, to its own end or to a goal."""

        def __call__(self, found: FileScene, *, goal: "Goal | None" = None) -> Started:
            """Start it."""


TITLE = re.compile(r"""title:\s*(?:"([^"\\]+)"|'([^']+)'|([^\s"'#|>&*!][^#\n]*?))\s*(?:#.*)?$""")
TITLE_WITHIN = 100  # lines of a file: longer files are not read for a list


class SessionDesk:
    """Acts on the simulation of a session, and informs its recorders."""

    def __init__(
        self,
        simulation: "Simulation",
        goal: "Goal",
        recorders: Sequence[Any],
        start: "Starter | None" = None,
    ) -> None:
        """Begin to keep the history; `start` makes the simulation of another scene, on the same device."""
        self.simulation, self.goal, self.recorders = simulation, goal, recorders
        self._start = start
        self._file = Path(simulation.scene.source)
        self._written = simulation.scene
        self.opened: Started | None = None
        self.history = History(simulation)
        self._stem = output_stem(simulation.scene.source)

    def desk(self) -> Desk:
        """The actions that the window can call."""
        knobs = [self._knob(slider) for slider in self.simulation.scene.sliders]
        actions = {name: getattr(self, name) for name in ("move", "back", "save", "log", "film", "open")}
        place = None if self._start is None else Folder.of(self._file)
        methods = None if self._start is None else self._methods()
        return Desk(knobs, present=self._file, place=place, title_of=title_of, methods=methods, **actions)

    def _methods(self) -> Methods:
        name = self._written.integrator.name
        found = partial(refusal, self._written)
        return Methods(component.names("integrators"), name, lambda: self.simulation.dt, found, about, self.choose)

    def _knob(self, slider: SliderSpec) -> Knob:
        def read() -> float:
            value = value_of(self.simulation.spec, slider.targets[0])
            assert value is not None  # a slider has a value
            return value

        return Knob(slider.path, slider.label, slider.low, slider.high, slider.logarithmic, read, slider.keys)

    def move(self, moved: Mapping[str, float]) -> str:
        """Set parameters; returns a message with the reason where this is not possible."""
        try:
            self.simulation.set(moved)
        except MppError as error:
            return str(error)
        self.history.keep()
        return ""

    def back(self) -> bool:
        """Go back by a frame, and remove later samples from the recorders."""
        if not self.history.back():
            return False
        for recorder in self.recorders:
            inner = recorder.recorder if isinstance(recorder, Timed) else recorder
            if isinstance(inner, (TableRecorder, InspectionRecorder)):
                inner.go_back(self.simulation)
            else:
                inner.restart()
        return True

    def save(self) -> str:
        """Write the state into the folder of outputs, numbered with the first free number."""
        (path,) = numbered(self._stem, ".npz")
        try:
            self.simulation.checkpoint(path)
        except OutputError as error:
            return str(error)
        return f"saved {path}"

    def log(self) -> str:
        """Write the log into the folder of outputs, numbered with the first free number.

        The log of a scene that reads other files is written into the folder of the scene.
        """
        scene = self.simulation.scene
        folder = self._file.parent if reads_files(scene) else OUTPUT_FOLDER
        (path,) = numbered(f"{self._stem}_log", ".yaml", folder=folder)
        try:
            save_log(path, self.simulation, self.goal)
        except OutputError as error:
            return str(error)
        return f"saved {path}"

    def film(self, size: tuple[int, int], fps: float) -> VideoRecorder:
        """Open a film in the folder of outputs, numbered with the first free number."""
        (path,) = numbered(self._stem, ".mp4")
        return VideoRecorder(path, size, fps)

    def open(self, file: Path) -> str:
        """Prepare the scene of another file; on a failure the returned line, also printed on the terminal, gives the reason."""
        return self._begin(lambda: scene_in(file, self.simulation.scene, self._written), None)

    def choose(self, method: str, dt: float) -> str:
        """Prepare the present scene with another integrator and step, from its present start; sliders stay where they are."""

        def found() -> FileScene:
            spec = with_method(self._written, self.simulation.spec, method, dt)
            start = self.simulation.start
            return FileScene(spec, start, Path(self.goal.state)) if start.time > 0.0 else FileScene(spec)

        return self._begin(found, self.goal)

    def _begin(self, found: Callable[[], FileScene], goal: "Goal | None") -> str:
        assert self._start is not None  # nothing else is offered
        try:
            self.opened = self._start(found(), goal=goal)
        except MppError as error:
            explain_error(error)
            return str(error).splitlines()[0]
        return ""


def title_of(file: Path) -> str:
    """The title that a scene's file gives, for a list; empty where no title is found."""
    if file.suffix.lower() not in SCENE_FILES:
        return ""
    try:
        with open(file, encoding="utf-8", errors="replace") as lines:
            found = (TITLE.match(line) for line in islice(lines, TITLE_WITHIN))
            return next((match[1] or match[2] or match[3] for match in found if match), "")
    except OSError:
        return ""


def save_log(path: Path, simulation: "Simulation", goal: "Goal") -> None:
    """Write all changes made so far as a scene file.

    Steps beyond the end of the run are left out: the end may have been reached by a shorter step, which a run of the log
    would not repeat.

    Raises:
        OutputError: the file cannot be written.
    """
    device = simulation.device
    options = f"--backend {device.backend} --precision {device.precision} --plan {simulation.plan}"
    begin = simulation.start.time
    lines = [
        f"What was done while {simulation.scene.source} ran, to t = {simulation.time:.9g}, {simulation.step_count} steps.",
        f"The same motion, bit for bit: python -m mpp_taichi run {path.name} {options}",
    ]
    if begin > 0.0:
        lines.append(f"It began at t = {begin:.9g}, from the state {goal.state}: add --rewind {goal.state} to the command.")
    end = simulation.time if goal.until is None else min(simulation.time, goal.until)
    write_log(path, simulation.scene, end, "\n".join(lines))
