"""Which of several ways is the fastest here: tried once, and remembered as long as the process lives."""

import time
from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

Way = TypeVar("Way")
REPEATS = 9  # of each way at most, for the sake of a machine that others use as well
ENOUGH = 0.1  # seconds after which a way is not tried again
HOPELESS = 2.0  # times the best so far, after which a way is not tried again
_remembered: dict[Hashable, object] = {}


def fastest(key: Hashable, ways: Sequence[Way], attempt: Callable[[Way], None]) -> Way:
    """The way whose `attempt`, which waits for its end, takes least time; the first attempt, which compiles, is not counted."""
    if len(ways) == 1:
        return ways[0]
    if key not in _remembered:
        best, least = ways[0], float("inf")
        for way in ways:
            attempt(way)
            spent = 0.0
            for _ in range(REPEATS):
                began = time.perf_counter()
                attempt(way)
                seconds = time.perf_counter() - began
                spent += seconds
                if seconds < least:
                    best, least = way, seconds
                if seconds > HOPELESS * least or spent > ENOUGH:
                    break
        _remembered[key] = best
    return _remembered[key]  # type: ignore[return-value]
