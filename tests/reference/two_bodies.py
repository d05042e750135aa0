"""Two bodies under gravity to 40 digits, from the very numbers at which a run starts.

Universal variables: χ with √μ dt = r dχ, Stumpff's functions c₂ and c₃ by their series. The root of Kepler's equation is found
by bisection and Newton's method. Source: Battin, An Introduction to the Mathematics and Methods of Astrodynamics (1999) §4.5.
"""

from decimal import Decimal, localcontext

DIGITS = 60


def two_bodies(mass, position, velocity, time, *, strength=1.0):
    """Positions of both bodies at `time` as decimals, from floats taken exactly: [[x, y, z], [x, y, z]]."""
    with localcontext() as context:
        context.prec = DIGITS
        m, t = [Decimal(float(each)) for each in mass], Decimal(float(time))
        x, v = ([[Decimal(float(c)) for c in row] for row in rows] for rows in (position, velocity))
        whole = sum(m)
        r = [b - a for a, b in zip(*x)]
        u = [b - a for a, b in zip(*v)]
        f, g = _lagrange(r, u, Decimal(float(strength)) * whole, t)
        apart = [f * a + g * b for a, b in zip(r, u)]
        middle = [sum(k * (place + t * speed) for k, place, speed in zip(m, *both)) / whole for both in zip(zip(*x), zip(*v))]
        return [[c + share * d for c, d in zip(middle, apart)] for share in (-m[1] / whole, m[0] / whole)]


def largest_error(found, expected):
    """Largest difference of a coordinate of floats from decimals."""
    with localcontext() as context:
        context.prec = DIGITS
        return float(max(abs(Decimal(float(a)) - b) for row, other in zip(found, expected) for a, b in zip(row, other)))


def _lagrange(r, u, mu, t):
    """f and g of r(t) = f r + g u."""
    distance, root = sum(a * a for a in r).sqrt(), mu.sqrt()
    along = sum(a * b for a, b in zip(r, u)) / root
    alpha = 2 / distance - sum(b * b for b in u) / mu

    def kepler(chi):
        """Kepler's equation and its derivative, which is the distance."""
        c, s = _stumpff(alpha * chi * chi)
        value = along * chi**2 * c + (1 - alpha * distance) * chi**3 * s + distance * chi - root * t
        slope = along * chi * (1 - alpha * chi**2 * s) + (1 - alpha * distance) * chi**2 * c + distance
        return value, slope

    low, high = Decimal(0), Decimal(1)
    while kepler(high)[0] < 0:
        high *= 2
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if kepler(middle)[0] < 0 else (low, middle)
    chi = low
    for _ in range(8):
        value, slope = kepler(chi)
        chi -= value / slope
    c, s = _stumpff(alpha * chi * chi)
    return 1 - chi**2 * c / distance, t - chi**3 * s / root


def _stumpff(z):
    """c₂(z) = Σ (−z)^k / (2k + 2)!, c₃(z) = Σ (−z)^k / (2k + 3)!."""
    c, s, term = Decimal(0), Decimal(0), Decimal(1) / 2
    for k in range(200):
        c, s = c + term, s + term / (2 * k + 3)
        term *= -z / ((2 * k + 3) * (2 * k + 4))
    return c, s
