"""Area of a polygon. Host only, float64."""

import numpy as np


def signed_area(corners: np.ndarray) -> float:
    """The area of a polygon with its sign, above 0 where its corners, (n, 2), go round from x to y [length²].

    It is summed about the first corner, so that a polygon far from the origin keeps its digits.
    """
    one, other = corners[1:-1] - corners[0], corners[2:] - corners[0]
    return 0.5 * float(np.sum(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]))
