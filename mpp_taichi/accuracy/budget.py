"""Budget: the wall time a study may take, shared out in advance."""

import time as clock
from collections.abc import Callable


class OutOfTime(Exception):  # noqa: N818 - a study that stops in time is no error
    """A run was left because the time that it may take is over."""


class Budget:
    """Counts down from its making. `look` is called between launches and may raise, for an interruption say."""

    def __init__(self, seconds: float, look: Callable[[], None] = lambda: None) -> None:
        """So many seconds from now on."""
        self.seconds, self.look = seconds, look
        self._began = clock.perf_counter()

    @property
    def spent(self) -> float:
        """Seconds since the start."""
        return clock.perf_counter() - self._began

    def left(self, share: float = 1.0) -> float:
        """Seconds until that share of the whole is spent; below zero beyond it."""
        return share * self.seconds - self.spent

    def check(self) -> None:
        """Go on, or not.

        Raises:
            OutOfTime: all of it is spent.
        """
        self.look()
        if self.left() <= 0.0:
            raise OutOfTime
