"""Functions through points: a cubic spline through the points (x_k, y_k) of a table, as a function of formulas.

    f(x) = c₀ + c₁ d + c₂ d² + c₃ d³  with d = x − x_k  for x_k ≤ x ≤ x_{k+1}

f, f′ and f″ are continuous. At both ends f‴ is continuous at the point next to the end as well ("not-a-knot"); a function that
repeats has the same f′ and f″ at both ends. Two points give a straight line, three a parabola. For a smooth function the error
is of fourth order in the distance of the points. Source: C. de Boor, A Practical Guide to Splines (2001), chapter IV.
"""

import hashlib
import math
from functools import cached_property
from typing import Any

import numpy as np

POINTS = "points"
"""The step ("points", x, function, k) of a program: the derivative k of a function through points."""
HIGHEST_DERIVATIVE = 3
BEYOND = 1e-6
"""Of the largest |x| of a table: so far beyond its ends the function goes on, since times are rounded to single precision."""


class PointFunction:
    """A function through points, which ascend in x; outside of the points it is no number unless it repeats."""

    def __init__(self, name: str, x: np.ndarray, y: np.ndarray, *, repeats: bool = False) -> None:
        """Take the points, (n,) each. A function that repeats has the same y at both ends."""
        self.name, self.x, self.y, self.repeats = name, np.asarray(x, float), np.asarray(y, float), repeats
        digest = hashlib.sha256(self.x.tobytes() + self.y.tobytes() + bytes([repeats]))
        self.digest = digest.hexdigest()[:24]

    def __eq__(self, other: object) -> bool:
        """Whether both are through the same points."""
        return isinstance(other, PointFunction) and self.digest == other.digest

    def __hash__(self) -> int:
        """Of the points."""
        return hash(self.digest)

    def __repr__(self) -> str:
        """The name and the digest of the points, which tell functions apart."""
        return f"{self.name}({self.digest})"

    @property
    def told(self) -> str:
        """Where the points are, for messages."""
        return f"the points of {self.name} reach from {self.x[0]:g} to {self.x[-1]:g}"

    @property
    def span(self) -> float:
        """The distance from the first to the last x, which is the period of a function that repeats."""
        return float(self.x[-1] - self.x[0])

    @cached_property
    def slack(self) -> float:
        """How far beyond the points the function goes on."""
        return BEYOND * float(np.abs(self.x[[0, -1]]).max())

    @cached_property
    def coefficients(self) -> np.ndarray:
        """c₀ to c₃ of each interval, (n − 1, 4)."""
        width = np.diff(self.x)
        rise = np.diff(self.y) / width
        slope = _periodic_slopes(width, rise) if self.repeats else _slopes(width, rise)
        second = (3.0 * rise - 2.0 * slope[:-1] - slope[1:]) / width
        third = (slope[:-1] + slope[1:] - 2.0 * rise) / width**2
        return np.stack([self.y[:-1], slope[:-1], second, third], axis=1)

    def at(self, x: Any, derivative: int = 0) -> Any:
        """The function, or a derivative of it, at some x; NaN outside of the points unless the function repeats."""
        x = np.asarray(x, float)
        value = _cubic(*self._piece(x, *self._interval(x)), derivative)
        if self.repeats:
            return value
        return np.where((x >= self.x[0] - self.slack) & (x <= self.x[-1] + self.slack), value, np.nan)

    def magnitude_at(self, x: Any, derivative: int = 0) -> Any:
        """The sum of the sizes of all terms, |c₀| + |c₁ d| + |c₂ d²| + |c₃ d³|, by which rounding errors are bounded."""
        x = np.asarray(x, float)
        d, c = self._piece(x, *self._interval(x))
        return _cubic(np.abs(d), np.abs(c), derivative)

    def spread_around(self, x: Any, derivative: int, reach: Any) -> tuple[Any, Any]:
        """How a derivative at x may change where x is known to ± reach: its largest slope, and the sum of its jumps.

        The slope is that of the cubics of the intervals at x − reach, x and x + reach, continued to x. At the points the third
        derivative jumps; the others jump by rounding errors of the coefficients on both sides.
        """
        x = np.asarray(x, float)
        (low, first), middle, (high, last) = (self._interval(each) for each in (x - reach, x, x + reach))
        pieces = [self._piece(x, *each) for each in ((low, first), middle, (high, last))]
        slope = np.max([np.abs(_cubic(*piece, derivative + 1)) for piece in pieces], axis=0)
        jumps = self._jumps(derivative)
        passed, whole = np.cumsum(jumps), float(jumps.sum())
        jump = np.abs(passed[high] - passed[low] + (last - first) * whole)
        rounding = np.finfo(float).eps * len(jumps) * whole  # of the sum
        return slope, np.where((high == low) & (last == first), 0.0, jump + rounding)

    def _jumps(self, derivative: int) -> np.ndarray:
        """By how much a derivative jumps at the begin of each interval, (n − 1,)."""
        before = _cubic(np.diff(self.x), self.coefficients, derivative)
        jumps = np.abs(np.roll(before, 1) - falling(derivative, derivative) * self.coefficients[:, derivative])
        if not self.repeats:
            jumps[0] = 0.0  # no interval is left of the first
        return jumps

    def _interval(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The number of the interval in which x is, and the number of its period."""
        period = np.floor((x - self.x[0]) / self.span) if self.repeats else np.zeros_like(x)
        place = x - period * self.span
        return np.clip(np.searchsorted(self.x, place, side="right") - 1, 0, len(self.x) - 2), period

    def _piece(self, x: np.ndarray, interval: np.ndarray, period: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """d = x − x_k, and the coefficients, (…, 4), of an interval in a period."""
        return x - period * self.span - self.x[interval], self.coefficients[interval]


def _cubic(d: np.ndarray, c: np.ndarray, derivative: int) -> np.ndarray:
    """A derivative of c₀ + c₁ d + c₂ d² + c₃ d³."""
    value = np.zeros_like(d)
    for power in range(HIGHEST_DERIVATIVE, derivative - 1, -1):
        value = value * d + falling(power, derivative) * c[..., power]
    return value


def falling(power: int, derivative: int) -> float:
    """The factor of d^(power − derivative) in a derivative of d^power."""
    return float(math.perm(power, derivative))


def _slopes(width: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """f′ at each point, from the continuity of f″, and of f‴ at the points next to the ends."""
    count = len(width) + 1
    if count == 2:
        return np.repeat(rise, 2)
    if count == 3:  # a parabola through all three
        bend = (rise[1] - rise[0]) / (width[0] + width[1])
        return np.array([rise[0] - bend * width[0], rise[0] + bend * width[0], rise[1] + bend * width[1]])
    below, middle, above, right = (np.zeros(count) for _ in range(4))
    middle[1:-1], below[1:-1], above[1:-1] = 2.0 * (width[:-1] + width[1:]), width[1:], width[:-1]
    right[1:-1] = 3.0 * (width[1:] * rise[:-1] + width[:-1] * rise[1:])
    for end, near, next_to, first, second in ((0, 0, 1, rise[0], rise[1]), (-1, -1, -2, rise[-1], rise[-2])):
        both = width[near] + width[next_to]
        middle[end] = width[next_to]
        (above if end == 0 else below)[end] = both
        right[end] = ((width[near] + 2.0 * both) * width[next_to] * first + width[near] ** 2 * second) / both
    return _solved(below, middle, above, right)


def _periodic_slopes(width: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """f′ at each point of a function that repeats: a cyclic system, split into one with a changed corner and a correction."""
    if len(width) == 1:
        return np.repeat(rise, 2)
    before, before_rise = np.roll(width, 1), np.roll(rise, 1)
    middle, below, above = 2.0 * (before + width), width.copy(), before.copy()
    right = 3.0 * (width * before_rise + before * rise)
    if len(width) == 2:  # each point has the other one on both sides
        matrix = np.array([[middle[0], below[0] + above[0]], [below[1] + above[1], middle[1]]])
        slopes = np.linalg.solve(matrix, right)
        return np.append(slopes, slopes[0])
    corner = -middle[0]
    lower, upper = above[-1], below[0]  # the two entries in the corners of the matrix
    middle[0] -= corner
    middle[-1] -= lower * upper / corner
    column = np.zeros(len(width))
    column[0], column[-1] = corner, lower
    one, other = _solved(below, middle, above, right), _solved(below, middle, above, column)
    share = (one[0] + upper * one[-1] / corner) / (1.0 + other[0] + upper * other[-1] / corner)
    slopes = one - share * other
    return np.append(slopes, slopes[0])


def _solved(below: np.ndarray, middle: np.ndarray, above: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution of a system with three diagonals, by elimination without exchanges: all but the end rows dominate."""
    lower, diagonal, upper, values = below.tolist(), middle.tolist(), above.tolist(), right.tolist()
    for row in range(1, len(values)):
        factor = lower[row] / diagonal[row - 1]
        diagonal[row] -= factor * upper[row - 1]
        values[row] -= factor * values[row - 1]
    values[-1] /= diagonal[-1]
    for row in range(len(values) - 2, -1, -1):
        values[row] = (values[row] - upper[row] * values[row + 1]) / diagonal[row]
    return np.array(values)
