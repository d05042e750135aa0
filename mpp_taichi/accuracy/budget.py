"""Budget: the wall time a study may take, shared out in advance."""

import time as clock
from collections.abc import Callable


class OutOfTime(Exception):  # noqa: N818 - a study that stops in time is no error
    """A run was stopped because its share of the time was spent."""


class Budget:
    """Counts down from its creation. `look` is called between launches and may raise, for instance after a signal."""

    def __init__(self, seconds: float, look: Callable[[], None] = lambda: None) -> None:
        """Begin to count down from a number of seconds."""
        self.seconds, self.look = seconds, look
        self._began = clock.perf_counter()

    @property
    def spent(self) -> float:
        """Seconds since the start."""
        return clock.perf_counter() - self._began

    def left(self, share: float = 1.0) -> float:
        """Seconds until this share of the whole budget is spent; negative afterwards."""
        return share * self.seconds - self.spent

    def check(self) -> None:
        """Raise when the run must stop.

        Raises:
            OutOfTime: the whole budget is spent.
        """
        self.look()
        if self.left() <= 0.0:
            raise OutOfTime
