"""Every: a recorder that calls a function of the user each time that so much simulated time has passed."""

import math
from collections.abc import Callable
from typing import Any

from mpp_taichi.errors import ArgumentError

ROUNDING = 1e-9  # of a step: a time that the clock reaches up to rounding is reached


class Every:
    """Calls `call(simulation)` at the first step that reaches each multiple of `interval` after the beginning of a run.

    The steps of the run do not depend on it: a call falls on a step, and for methods that choose their own steps on a sample.
    """

    def __init__(self, interval: float, call: Callable[[Any], object], begin: float) -> None:
        """Call first at the time `begin` + `interval`.

        Raises:
            ArgumentError: the interval is not a finite time above 0, or there is nothing to call.
        """
        if not (isinstance(interval, (int, float)) and math.isfinite(interval) and interval > 0.0):
            raise ArgumentError(f"every must be a time above 0, got {interval!r}")
        if not callable(call):
            raise ArgumentError(f"call must be a function of the simulation, got {call!r}")
        self._interval, self._call, self._begin, self._done = float(interval), call, begin, 0

    def steps_until_due(self, simulation: Any) -> int:
        """Steps until the next multiple is reached."""
        ahead = (self._begin + (self._done + 1) * self._interval - simulation.time) / simulation.dt
        return max(0, math.ceil(min(ahead - ROUNDING, 2.0**31)))

    def record(self, simulation: Any) -> None:
        """Call the function once, also where one step has passed several multiples."""
        passed = (simulation.time - self._begin) / self._interval
        self._done = max(self._done + 1, math.floor(passed + ROUNDING * simulation.dt / self._interval))
        self._call(simulation)


def calls(every: float | None, call: Callable[[Any], object] | None, begin: float) -> list[Every]:
    """The recorder of the arguments `every` and `call` of a run; none where both are absent.

    Raises:
        ArgumentError: only one of them was given.
    """
    if every is None and call is None:
        return []
    if every is None or call is None:
        raise ArgumentError("every and call go together: run(until=…, every=10.0, call=f) calls f(simulation)")
    return [Every(every, call, begin)]
