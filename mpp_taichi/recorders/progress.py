"""Progress: a bar on a terminal, or a line from time to time in a log."""

import sys
import time as clock
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

BAR_SECONDS = 0.1  # at most ten updates a second
LINE_SECONDS = 30.0
LINE_PERCENT = 10


class ProgressRecorder:
    """Shows step count and time, and reads nothing from the device, so that it costs nothing. A context manager.

    On a terminal: a bar with per cent, steps per second, simulated time, time left and the last known energy error. Otherwise
    one plain line for every tenth of the run, or half a minute. Steps per second are of this process since its kernels were
    compiled, with samples and pictures, as in the closing summary.
    """

    def __init__(self, total_steps: int | None, energy_error: Callable[[], float | None], *, bar: bool) -> None:
        """`total_steps` is None for a run without an end; `energy_error` gives the error of the last sample."""
        self.total_steps = total_steps
        self.energy_error = energy_error
        self._looked = self._began = clock.perf_counter()
        self._told_percent = 0
        self._told = self._began
        self._bar: Any = _make_bar(total_steps) if bar else None
        self._task: Any = None
        self._first: tuple[int, float] | None = None  # the step, and the seconds of compiling, before the first launch

    def __enter__(self) -> "ProgressRecorder":
        """Show the bar."""
        if self._bar is not None:
            self._bar.start()
            self._task = self._bar.add_task("compiling", total=self.total_steps, state="compiling kernels")
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()

    def steps_until_due(self, simulation: "Simulation") -> int:
        """0 when the clock says that the bar is due, else a number that is never reached."""
        if self._first is None:
            self._first = simulation.step_count, simulation.timings.compile_seconds
        return 0 if clock.perf_counter() - self._looked >= BAR_SECONDS else 2**31

    def record(self, simulation: "Simulation") -> None:
        """Move the bar, or print a line when it is time."""
        self._looked = clock.perf_counter()
        if self._bar is not None:
            self._bar.update(self._task, completed=simulation.step_count, state=self._state(simulation))
            return
        percent = int(100 * simulation.step_count / self.total_steps) if self.total_steps else 0
        tenth = percent // LINE_PERCENT * LINE_PERCENT
        is_time = tenth > self._told_percent or self._looked - self._told >= LINE_SECONDS
        if sys.stderr is not None and simulation.step_count and is_time:
            self._told_percent, self._told = tenth, self._looked
            lead = f"{percent:3d} %  " if self.total_steps else ""
            print(f"{lead}{self._state(simulation)}{self._left(simulation)}", file=sys.stderr, flush=True)

    def _state(self, simulation: "Simulation") -> str:
        if not simulation.timings.advance_seconds:
            return "compiling kernels"
        error = self.energy_error()
        told = f" · ΔE/E {error:.1e}" if error is not None else ""
        rate = self._rate(simulation)
        speed = f"{rate:,.0f}" if rate >= 100.0 else f"{rate:.3g}"
        return f"{speed} steps/s · t = {simulation.time:.6g}{told}"

    def _rate(self, simulation: "Simulation") -> float:
        """Steps per second since the kernels were compiled."""
        step, compiled = self._first or (0, 0.0)
        seconds = clock.perf_counter() - self._began - (simulation.timings.compile_seconds - compiled)
        return (simulation.step_count - step) / max(seconds, 1e-9)

    def _left(self, simulation: "Simulation") -> str:
        if not self.total_steps:
            return ""
        rate = self._rate(simulation)
        return f" · {(self.total_steps - simulation.step_count) / rate:.0f} s left" if rate > 0.0 else ""


def _make_bar(total_steps: int | None) -> Any:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = [BarColumn(), TaskProgressColumn(), TimeRemainingColumn()] if total_steps else []
    state = TextColumn("{task.fields[state]}", markup=False)
    return Progress(*columns, state, console=Console(stderr=True), transient=True, refresh_per_second=10)
