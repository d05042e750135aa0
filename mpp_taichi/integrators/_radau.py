"""Gauss–Radau nodes, and the change of basis between divided differences and powers. Host side; no Taichi."""

from decimal import Decimal, localcontext
from fractions import Fraction
from math import comb

DIGITS = 40


def radau_nodes(count: int) -> tuple[float, ...]:
    """The `count` nodes, beside the node 0, of Gauss–Radau quadrature on 0 … 1, correctly rounded.

    They are the zeros other than 0 of P_count+1(1 − 2 s) − P_count(1 − 2 s), with Legendre's polynomials
    P_n(1 − 2 s) = Σ_k (−1)^k C(n, k) C(n + k, k) s^k.
    They integrate polynomials of degree 2 count exactly. Source: Abramowitz & Stegun, 25.4.31; Everhart, Int. Astron. Union
    Colloq. 83 (1985) 185.
    """
    difference = [Fraction(0)] * (count + 2)
    for degree, sign in ((count, -1), (count + 1, 1)):
        for k in range(degree + 1):
            difference[k] += sign * (-1) ** k * comb(degree, k) * comb(degree + k, k)
    assert difference[0] == 0
    return tuple(float(root) for root in _zeros(difference[1:]))


def _zeros(coefficients: list[Fraction]) -> list[Decimal]:
    """Zeros of a polynomial in 0 … 1, all simple and real, by bisection between changes of its sign."""
    degree = len(coefficients) - 1

    def value(s: Fraction) -> Fraction:
        result = Fraction(0)
        for c in reversed(coefficients):
            result = result * s + c
        return result

    steps = 64 * degree
    places = [Fraction(k, steps) for k in range(1, steps + 1)]
    roots = []
    with localcontext() as context:
        context.prec = DIGITS
        for low, high in zip(places, places[1:]):
            if value(low) * value(high) < 0:
                sign = value(low) > 0
                for _ in range(4 * DIGITS):
                    middle = (low + high) / 2
                    if (value(middle) > 0) == sign:
                        low = middle
                    else:
                        high = middle
                roots.append(Decimal(low.numerator) / Decimal(low.denominator))
    assert len(roots) == degree
    return roots


def powers_of_differences(nodes: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    """Row j: the coefficients of s^1 … s^(j+1) in the product s (s − h_1) … (s − h_j)."""
    rows = [[Fraction(1)]]
    for node in nodes[:-1]:
        before = rows[-1]
        h = Fraction(node)
        rows.append([-h * a + b for a, b in zip([*before, Fraction(0)], [Fraction(0), *before])])
    return tuple(tuple(map(float, row)) for row in rows)


def differences_of_powers(nodes: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    """Row k: s^(k+1) as a sum of the products s (s − h_1) … (s − h_j), j ≤ k; the coefficients of the sum."""
    rows = [[Fraction(1)]]
    for _ in nodes[:-1]:
        before = rows[-1]
        # s · s(s − h_1)…(s − h_j) = the next product + h_(j+1) times this product.
        following = [Fraction(0)] * (len(before) + 1)
        for j, a in enumerate(before):
            following[j + 1] += a
            following[j] += Fraction(nodes[j]) * a
        rows.append(following)
    return tuple(tuple(map(float, row)) for row in rows)


def integrals(nodes: tuple[float, ...], ends: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    """Row e: the weights of the values at the nodes in the integral from 0 to ends[e] of the polynomial through the values."""
    places = [Fraction(node) for node in nodes]
    rows = []
    for end in map(Fraction, ends):
        row = []
        for j, own in enumerate(places):
            product, scale = [Fraction(1)], Fraction(1)  # ∏ (s − s_i) by powers of s, and its value at s_j
            for other in (*places[:j], *places[j + 1 :]):
                product = [a - other * b for a, b in zip([Fraction(0), *product], [*product, Fraction(0)])]
                scale *= own - other
            row.append(float(sum(c * end ** (k + 1) / (k + 1) for k, c in enumerate(product)) / scale))
        rows.append(tuple(row))
    return tuple(rows)
