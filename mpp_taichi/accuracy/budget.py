"""Budget: the processor time that a study may take, shared out in advance.

Processor time, and not wall time: a study beside other busy programs makes the same decisions as a study alone. The time that
the process waits for another device, such as a GPU, is wall time, and counts as well.
"""

import contextlib
import time
from collections.abc import Callable, Iterator


class OutOfTime(Exception):  # noqa: N818 - a study that stops in time is no error
    """A run was stopped because its share of the time was spent."""


class Budget:
    """Counts the processor time of all threads of this process from the budget's creation.

    seconds   the whole budget, of which shares are taken [s]
    overtime  what may be spent beyond the budget, for work that a study cannot do without [s]

    `look` is called between launches and may raise, for instance after a signal.
    """

    def __init__(
        self, seconds: float, look: Callable[[], None] = lambda: None, clock: Callable[[], float] = time.process_time
    ) -> None:
        """Begin to count, with no overtime. Work in other processes is counted by another clock, `time.perf_counter`."""
        self.seconds, self.look, self.clock = seconds, look, clock
        self.overtime = 0.0
        self._began, self._waited = clock(), 0.0

    @property
    def spent(self) -> float:
        """Seconds of processor time, and of waiting for another device, since the start."""
        return self.clock() - self._began + self._waited

    def wait(self, seconds: float) -> None:
        """Count wall time in which the process waited for another device [s]."""
        self._waited += seconds

    @property
    def used(self) -> float:
        """The part of the budget that is spent; overtime does not count."""
        return (self.spent - self.overtime) / self.seconds

    @contextlib.contextmanager
    def beyond(self, times: float, share: float) -> Iterator[None]:
        """Allow `times` the budget in this block; afterwards all that was spent beyond a share of the budget is overtime."""
        self.overtime = (times - 1.0) * self.seconds
        try:
            yield
        finally:
            self.overtime = 0.0
            self.overrun(share)

    def overrun(self, share: float) -> None:
        """Take as overtime all that was spent beyond a share of the budget, so that the rest of the budget is left."""
        self.overtime = max(self.overtime, self.spent - share * self.seconds)

    def left(self, share: float = 1.0) -> float:
        """Seconds until this share of the whole budget, and the overtime, are spent; negative afterwards."""
        return share * self.seconds + self.overtime - self.spent

    def check(self) -> None:
        """Raise when the run must stop.

        Raises:
            OutOfTime: the whole budget and the overtime are spent.
        """
        self.look()
        if self.left() <= 0.0:
            raise OutOfTime
