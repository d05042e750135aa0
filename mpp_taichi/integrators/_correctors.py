"""Symplectic correctors of a splitting into a large part and a small one. Host side; no Taichi.

To first order in the small part B, a step D(½) K(1) D(½) of drifts by the large part A and kicks by B is the flow of
h A + h φ(x) B, φ(x) = (x/2) / sinh(x/2), where x = h [A, ·]; and a change of coordinates e^S turns that flow into the flow of
h A + h B if S = h (φ(x) − 1)/x B. Such a change is built from drifts and kicks as a product of
Z(a, b) = D(a) K(b) D(−2a) K(−b) D(a), which is e^S with S = 2 b h sinh(a x) B. A product whose series agrees with the
series of (φ − 1)/x up to x^(n−2) is a corrector of order n; it reduces the error of a step from ε h² to ε h^(n+1) + ε² h².
Sources: Wisdom, Holman & Touma, Fields Inst. Commun. 10 (1996) 217; Wisdom, Astron. J. 131 (2006) 2294.
"""

from fractions import Fraction
from math import factorial, sqrt

SPACING_SQUARED = Fraction(7, 40)  # the a are multiples of its square root, as Wisdom chose them
ORDERS = (0, 3, 5, 7, 11, 17)


def stages(order: int) -> tuple[tuple[float, float], ...]:
    """(a, b) of each factor Z, in parts of the step; no factor for order 0."""
    count = max(0, order - 1) // 2
    wanted = error_series(count)
    # In B = b √(spacing²) the conditions Σ 2 b_i a_i^(2k−1) / (2k−1)! are rational.
    rows = [
        [Fraction(2 * i ** (2 * k - 1), factorial(2 * k - 1)) * SPACING_SQUARED ** (k - 1) for i in range(1, count + 1)]
        for k in range(1, count + 1)
    ]
    spacing = sqrt(SPACING_SQUARED)
    return tuple((i * spacing, float(b) / spacing) for i, b in enumerate(_solved(rows, wanted), start=1))


def error_series(count: int) -> list[Fraction]:
    """Coefficients of x, x³, … in (φ(x) − 1)/x, where φ is the reciprocal of sinh(x/2) / (x/2)."""
    sinh = [Fraction(1, 4**k * factorial(2 * k + 1)) for k in range(count + 1)]
    phi: list[Fraction] = []
    for k in range(count + 1):
        phi.append(Fraction(k == 0) - sum((sinh[j] * phi[k - j] for j in range(1, k + 1)), Fraction(0)))
    return phi[1:]


def _solved(rows: list[list[Fraction]], wanted: list[Fraction]) -> list[Fraction]:
    """Solution of a linear system by Gauss and Jordan's elimination, in exact fractions."""
    table = [[*row, value] for row, value in zip(rows, wanted, strict=True)]
    for k in range(len(table)):
        pivot = next(row for row in table[k:] if row[k] != 0)
        table.remove(pivot)
        table.insert(k, [value / pivot[k] for value in pivot])
        for j, row in enumerate(table):
            if j != k:
                table[j] = [value - row[k] * other for value, other in zip(row, table[k], strict=True)]
    return [row[-1] for row in table]


def opening(order: int) -> tuple[tuple[float, float], ...]:
    """(kick, drift) in parts of the step, from the true state to the middle of the first step; the first kick is 0."""
    kicks, drifts = [0.0], [0.0]
    for a, b in stages(order):
        kicks += [b, -b]
        drifts[-1] += a
        drifts += [-2.0 * a, a]
    drifts[-1] += 0.5
    return tuple(zip(kicks, drifts, strict=True))


def closing(order: int) -> tuple[tuple[float, float], ...]:
    """The way back: the same drifts and kicks, each undone, in opposite order."""
    kicks, drifts = zip(*opening(order), strict=True)
    return tuple(zip((0.0, *(-kick for kick in reversed(kicks[1:]))), (-drift for drift in reversed(drifts)), strict=True))
