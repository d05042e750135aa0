"""Bodies at random places, which every precision holds exactly."""

from typing import Any

import numpy as np

GRID = 2.0**-10  # places are multiples of it, so that every precision holds them exactly


def random_bodies(count: int, *, charged: bool = False, seed: int = 1) -> list[dict[str, Any]]:
    """Entries of `particles:`: masses from ½ to 2 in a cube of side 2, without or with charges of both signs."""
    random = np.random.default_rng(seed)
    places = np.round(random.uniform(-1, 1, (count, 3)) / GRID) * GRID
    masses = np.round(random.uniform(0.5, 2.0, count) / GRID) * GRID
    charges = np.round(random.uniform(-1, 1, count) / GRID) * GRID
    bodies = [{"mass": float(m), "position": [float(x) for x in place]} for m, place in zip(masses, places)]
    if charged:
        bodies = [body | {"charge": float(q)} for body, q in zip(bodies, charges)]
    return [{"body": body} for body in bodies]
