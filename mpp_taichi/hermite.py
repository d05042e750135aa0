"""Cubic Hermite interpolation between two looks at a quantity and its rate."""


def crossing(begin: float, end: float, before: tuple[float, float], after: tuple[float, float], *, level: float) -> float:
    """When the cubic through (value, rate) at `begin` and at `end` reaches `level`; by bisection, to the last bit.

    The two values must lie on different sides of the level, or on it. The cubic is good to h⁴/384 times the fourth derivative.
    """
    h = end - begin
    rises = after[0] >= before[0]

    def value(s: float) -> float:
        rise = s * s * (3.0 - 2.0 * s)
        return (1.0 - rise) * before[0] + rise * after[0] + h * s * (1.0 - s) * ((1.0 - s) * before[1] - s * after[1])

    low, high = 0.0, 1.0
    while high - low > 1e-15:
        middle = 0.5 * (low + high)
        beyond = value(middle) >= level if rises else value(middle) <= level
        low, high = (low, middle) if beyond else (middle, high)
    return begin + high * h
