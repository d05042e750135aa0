"""Times of a first contact, against a search along the flight in NumPy."""

from collections.abc import Callable

import numpy as np

SEARCHED = 2_001  # times along a flight


def assert_first_contacts(
    found: np.ndarray,
    flights: tuple[np.ndarray, np.ndarray, np.ndarray],
    end: float,
    gap: Callable[[np.ndarray, np.ndarray], np.ndarray],
    allowed: float,
) -> None:
    """No contact in the search is earlier than the times found, and at these times the gap is 0 up to `allowed`.

    `found` (2, count) holds the times in straight and in falling flight, infinite without a contact. `flights` are places,
    velocities and accelerations (count, 3); `gap` gives the gaps at places (n, 3) and times (n,).
    """
    x, v, a = flights
    times = np.linspace(0.0, end, SEARCHED)
    for fall, results in enumerate(found):
        assert np.isfinite(results).sum() > len(x) / 20 and np.isinf(results).any()
        for i, s in enumerate(results):
            way = x[i] + np.outer(times, v[i]) + fall * np.outer(times**2 / 2, a[i])
            touching = np.flatnonzero(gap(way, times) <= 0)
            if len(touching):
                assert s <= times[touching[0]]
            if np.isfinite(s):
                there = x[i] + s * v[i] + fall * s * s / 2 * a[i]
                assert abs(gap(there[None], np.array([s]))[0]) < allowed
