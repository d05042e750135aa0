"""Which of several ways is the fastest here: tried once, and remembered as long as the process lives."""

import time
from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

Way = TypeVar("Way", bound=Hashable)
ROUNDS = 25  # in which each way is tried once, so that what else the machine does falls on all of them
ENOUGH = 0.3  # seconds after which a way is not tried again
HOPELESS = 3.0  # times the best so far, after which it is not either
_remembered: dict[Hashable, object] = {}


def fastest(key: Hashable, ways: Sequence[Way], attempt: Callable[[Way], None]) -> Way:
    """The way whose `attempt`, which waits for its end, takes least time; the first attempt, which compiles, is not counted."""
    if len(ways) == 1:
        return ways[0]
    if key not in _remembered:
        least: dict[Way, float] = {}
        spent = dict.fromkeys(ways, 0.0)
        for number in range(ROUNDS):
            for way in ways:
                if number == 0:
                    attempt(way)
                elif spent[way] > ENOUGH or least[way] > HOPELESS * min(least.values()):
                    continue
                began = time.perf_counter()
                attempt(way)
                seconds = time.perf_counter() - began
                spent[way] += seconds
                least[way] = min(seconds, least.get(way, seconds))
        _remembered[key] = min(ways, key=lambda way: least[way])
    return _remembered[key]  # type: ignore[return-value]
