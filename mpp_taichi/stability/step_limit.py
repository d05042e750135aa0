"""Step limit: the largest step with which an integrator keeps an oscillator bounded, from its amplification matrix."""

import math
from collections.abc import Callable

import numpy as np

Amplification = Callable[[float, float], np.ndarray]
"""(ω dt, γ dt) → matrix of one step, as `Integrator.amplification`."""

# A step is stable where no eigenvalue is beyond 1 by more than the rounding of the matrix.
ROUNDING = 1e-13
ROUNDING_OF_ROOTS = 1e-6  # a double eigenvalue ±1 has a rounding error of the square root of the matrix's rounding error
FIRST = 0.02  # angle per step at which a growth of fourth order in it, as RK2's y⁴/4, is larger than rounding
STRIDE = 0.1
FAR = 10.0  # beyond this angle the search goes on by a factor instead of a stride
FACTOR = 1.3
FARTHEST = 1e8  # an integrator that is stable up to this angle has no limit


def margins(matrix: np.ndarray) -> tuple[float, ...]:
    """The distance of a step from stability, by each criterion: where a margin is above 0, some oscillation grows.

    A matrix of two rows is judged by determinant and trace (Jury), det ≤ 1 and |trace| ≤ 1 + det, which rounding hardly
    changes where two eigenvalues meet on the unit circle, as they do at every limit of a symplectic method. The matrix of a
    longer state is judged by its spectral radius.
    """
    if not np.isfinite(matrix).all():
        return (math.inf,)
    if len(matrix) == 2:
        trace = matrix[0, 0] + matrix[1, 1]
        determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
        tolerance = ROUNDING * max(1.0, float(np.abs(matrix).max()) ** 2)
        return float(determinant) - 1.0 - tolerance, float(abs(trace) - 1.0 - determinant) - tolerance
    return (spectral_radius(matrix) - 1.0 - ROUNDING_OF_ROOTS,)


def excess(matrix: np.ndarray) -> float:
    """The largest of the margins."""
    return max(margins(matrix))


def spectral_radius(matrix: np.ndarray) -> float:
    """Growth of the fastest growing state, per step."""
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def largest_stable_step(amplification: Amplification, frequency: float, damping: float = 0.0) -> float:
    """Largest dt such that every smaller one is stable on x" = −ω² x − γ x′ [time].

    Infinite for a method without a limit, 0 for a method that is stable for no useful step (explicit Euler and other methods of
    low order without damping; `growth_per_step` tells how fast oscillations grow). The search goes up to the first unstable
    step, then bisects to rounding. Composed methods have narrow unstable gaps near half a turn per step; each maximum of a
    margin below 0 is searched for such a gap.
    """
    rate = max(frequency, damping)
    if rate == 0.0:
        return math.inf

    def margins_at(angle: float) -> tuple[float, ...]:
        return margins(amplification(frequency / rate * angle, damping / rate * angle))

    def excess_at(angle: float) -> float:
        return max(margins_at(angle))

    if excess_at(FIRST) > 0.0:
        return _below_first(excess_at) / rate if damping > 0.0 else 0.0
    before, stable = FIRST, FIRST
    behind = here = margins_at(FIRST)
    while stable < FARTHEST:
        angle = stable + STRIDE if stable < FAR else stable * FACTOR
        ahead = margins_at(angle)
        if angle < FAR and len(behind) == len(ahead):
            for number, (a, b, c) in enumerate(zip(behind, here, ahead)):
                if b > max(a, c) + ROUNDING and b > -(STRIDE**2):
                    peak = _highest(margins_at, number, before, angle)
                    if excess_at(peak) > 0.0:
                        return _bisect(excess_at, before, peak) / rate
        if max(ahead) > 0.0:
            return _bisect(excess_at, stable, angle) / rate
        before, stable, behind, here = stable, angle, here, ahead
    return math.inf


def growth_per_step(amplification: Amplification, frequency: float, damping: float, dt: float) -> float:
    """Spectral radius of a step, 1 where no oscillation grows."""
    matrix = amplification(frequency * dt, damping * dt)
    return spectral_radius(matrix) if excess(matrix) > 0.0 else 1.0


def _below_first(excess_at: Callable[[float], float]) -> float:
    """Limit of a method that is stable thanks to damping only; 0 where no stable step is found."""
    unstable = FIRST
    for _ in range(4):
        if excess_at(0.5 * unstable) <= 0.0:
            return _bisect(excess_at, 0.5 * unstable, unstable)
        unstable *= 0.5
    return 0.0


def _bisect(excess_at: Callable[[float], float], stable: float, unstable: float) -> float:
    while unstable - stable > 1e-13 * unstable:
        middle = 0.5 * (stable + unstable)
        if excess_at(middle) <= 0.0:
            stable = middle
        else:
            unstable = middle
    return stable


def _highest(margins_at: Callable[[float], tuple[float, ...]], number: int, low: float, high: float) -> float:
    """The angle at which one of the margins is largest, by golden sections."""
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    for _ in range(30):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        if margins_at(left)[number] > margins_at(right)[number]:
            high = right
        else:
            low = left
    return 0.5 * (low + high)
