"""Step clock: the time of steps on a CPU, as it is while no other program takes the processors.

The wall time of a launch grows with the load of the machine; the processor time of the process does not. A launch that works
with several threads takes its processor time over its parallelism, the ratio of processor time to wall time on a quiet machine.
Load only lowers the ratio, so the largest ratio that was seen counts. On other devices wall time is all there is.
"""

import functools
import time as clock
from collections.abc import Callable
from dataclasses import dataclass

LEAST_WALL = 1e-3  # s of a launch whose ratio of times counts: threads that wait for their next loop spin for 50 µs
FINEST_STEP = 1e-4  # s: a clock of processor time with coarser steps cannot time a launch
PATIENCE = 0.05  # s to wait for a step of this clock


@dataclass(frozen=True)
class LaunchTime:
    """The wall time and the processor time of a launch [s]."""

    wall: float
    processor: float

    @property
    def waited(self) -> float:
        """Wall time in which the process itself did nothing [s]."""
        return max(0.0, self.wall - self.processor)


class StepClock:
    """Times the launches of one compiled method.

    most_threads  threads that work on its loops; 0 where another device does the work, whose launches take wall time
    parallelism   the largest ratio of processor time to wall time so far, from 1 to `most_threads`
    """

    def __init__(self, most_threads: int) -> None:
        """Begin without a launch."""
        self.most_threads = most_threads if has_fine_steps() else 0
        self.parallelism = 1.0

    def time(self, launch: Callable[[], None]) -> LaunchTime:
        """The times of a launch, which must end when its work is done."""
        wall, processor = clock.perf_counter(), clock.process_time()
        launch()
        took = LaunchTime(clock.perf_counter() - wall, clock.process_time() - processor)
        if took.wall >= LEAST_WALL:
            self.parallelism = max(self.parallelism, min(took.processor / took.wall, float(self.most_threads)))
        return took

    def seconds(self, took: LaunchTime) -> float:
        """The time of a launch on a quiet machine [s]."""
        return took.processor / self.parallelism if self.most_threads else took.wall


@functools.cache
def has_fine_steps() -> bool:
    """Whether the clock of processor time has steps so short that it can time a launch; on some systems they take 16 ms."""
    end, before = clock.perf_counter() + PATIENCE, clock.process_time()
    while clock.perf_counter() < end:
        now = clock.process_time()
        if now > before:
            return now - before < FINEST_STEP
    return False
