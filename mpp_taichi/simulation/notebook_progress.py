"""Progress of a run below a notebook's cell: one line, from the second second on, that goes away at the end."""

import contextlib
import math
import sys
import time as clock
from collections.abc import Iterator, Sequence
from typing import Any

from mpp_taichi.simulation.recorder import Recorder

FIRST_SECONDS = 1.0  # a shorter run shows nothing
SECONDS = 0.5  # between two changes of the line


def shell() -> Any:
    """The shell of IPython where cells are shown by a notebook, else None; IPython is not imported for it."""
    found = sys.modules.get("IPython")
    running = found.get_ipython() if found is not None else None
    return running if getattr(running, "kernel", None) is not None else None


@contextlib.contextmanager
def shown_progress(simulation: Any, span: float, steps: float) -> Iterator[Sequence[Recorder]]:
    """The recorder that shows the way through a run of so much time, or of so many steps; none outside of notebooks."""
    if shell() is None:
        yield ()
        return
    progress = CellProgress(simulation, span, steps)
    try:
        yield (progress,)
    finally:
        progress.clear()


class CellProgress:
    """The line; it reads the clock and the time of the simulation, and copies nothing from the device."""

    def __init__(self, simulation: Any, span: float, steps: float) -> None:
        """Begin a run of the time `span`, or of `steps` where that is less."""
        self._time, self._step, self._span, self._steps = simulation.time, simulation.step_count, span, steps
        self._began = clock.perf_counter()
        self._looked = self._began + FIRST_SECONDS - SECONDS
        self._handle: Any = None

    def steps_until_due(self, simulation: Any) -> int:
        """0 when the clock says that the line is due, else a number that is never reached."""
        return 0 if clock.perf_counter() - self._looked >= SECONDS else 2**31

    def record(self, simulation: Any) -> None:
        """Show the line, or change it."""
        from IPython.display import HTML, display

        self._looked = clock.perf_counter()
        line = HTML(f"<small>{self.line(simulation)}</small>")
        if self._handle is None:
            self._handle = display(line, display_id=True)
        else:
            self._handle.update(line)

    def line(self, simulation: Any) -> str:
        """`45 %, t = 3.2, 1,200 steps/s, 12 s left`."""
        seconds, steps = clock.perf_counter() - self._began, simulation.step_count - self._step
        by_time = (simulation.time - self._time) / self._span if 0.0 < self._span < math.inf else 0.0
        done = min(1.0, max(by_time, steps / self._steps if 0.0 < self._steps < math.inf else 0.0))
        left = f", {seconds * (1.0 - done) / done:.0f} s left" if done > 0.0 else ""
        return f"{100.0 * done:.0f} %, t = {simulation.time:.6g}, {steps / seconds:,.0f} steps/s{left}"

    def clear(self) -> None:
        """Take the line away, if it was shown."""
        if self._handle is not None:
            from IPython.display import HTML

            self._handle.update(HTML(""))
