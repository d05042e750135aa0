"""Kepler's problem: the motion of a body about a fixed mass over a given time, on any conic."""

import math

import taichi as ti

# Terms of the series of c₂ and c₃ and the largest |z| they are summed at: the first term left out is below 4e-17 of the sum.
TERMS = 7
LARGEST_ARGUMENT = 1.0 / 3.0
SERIES_2 = tuple((-1.0) ** k / math.factorial(2 * k + 2) for k in range(TERMS))
SERIES_3 = tuple((-1.0) ** k / math.factorial(2 * k + 3) for k in range(TERMS))
SMALL = 0.1  # relative change of the distance over a step up to which the first guess of the anomaly is a series
CLOSE = 1e-6  # a correction so small, relative to the anomaly, that the next correction is round-off
QUICK = 12  # iterations of third order; later iterations halve the bracket
MOST = 1200  # iterations of both kinds; halvings take at most 1074, from the largest number to the smallest


@ti.func
def stumpff(z):
    """c₂ and c₃ of z, c_n = Σ_k (−z)^k / (n + 2k)!: by a series where z is small, else from the values at z/4.

    c₂(4z) = c₁² / 2 and c₃(4z) = (c₂ + c₀ c₃) / 4 with c₀ = 1 − z c₂, c₁ = 1 − z c₃. Source: Stumpff, Himmelsmechanik I (1959);
    Mikkola & Innanen, Celest. Mech. Dyn. Astron. 74 (1999) 59.
    """
    quarters = 0
    while ti.abs(z) > LARGEST_ARGUMENT and quarters < 600:
        z *= 0.25
        quarters += 1
    c2, c3 = ti.cast(SERIES_2[TERMS - 1], float), ti.cast(SERIES_3[TERMS - 1], float)
    for back in ti.static(range(1, TERMS)):
        c2 = c2 * z + SERIES_2[TERMS - 1 - back]
        c3 = c3 * z + SERIES_3[TERMS - 1 - back]
    while quarters > 0:
        c1 = 1.0 - z * c3
        c3 = 0.25 * (c2 + (1.0 - z * c2) * c3)
        c2 = 0.5 * c1 * c1
        z *= 4.0
        quarters -= 1
    return c2, c3


@ti.func
def kepler_changes(x, v, mu, duration):
    """Changes of position and velocity over a time of either sign, about a centre of G × mass `mu` at rest at the origin.

    With r the distance, β = 2μ/r − v², η = x·v, ζ = μ − β r and G_n = X^n c_n(β X²) the time to the anomaly X is
        t = r X + η G₂ + ζ G₃,  t′ = r + η G₁ + ζ G₂ = r(X),  t″ = η G₀ + ζ G₁,
    the same for ellipse, parabola and hyperbola. The time grows with X, so that Halley's iteration can be kept in a bracket.
    The bracket is halved where an iterate lies outside of it, and after QUICK iterations. Whole periods are left out. The third
    value returned says whether X was found.
    Source: Stiefel & Scheifele, Linear and Regular Celestial Mechanics (1971) §11; Rein & Tamayo, Mon. Not. R. Astron. Soc. 452
    (2015) 376; Wisdom & Hernandez, Mon. Not. R. Astron. Soc. 453 (2015) 3015.
    """
    r = x.norm()
    inverse = 1.0 / r
    beta = 2.0 * mu * inverse - v.norm_sqr()
    t = duration
    if beta > 0.0 and beta * beta * beta * t * t > math.pi**2 * mu * mu:
        period = 2.0 * math.pi * mu / (beta * ti.sqrt(beta))
        t -= period * ti.floor(t / period + 0.5)
    # A motion backwards in time is a motion forwards with the opposite velocity.
    sense = ti.select(t < 0.0, ti.cast(-1.0, float), ti.cast(1.0, float))
    t *= sense
    eta = sense * x.dot(v)
    zeta = mu - beta * r
    straight = t * inverse
    a, b = eta * inverse, zeta * inverse
    anomaly = straight * (1.0 - straight * (0.5 * a - straight * (0.5 * a * a - b / 6.0)))
    if not straight * (ti.abs(a) + straight * ti.abs(b)) < SMALL:
        anomaly = straight
        if beta > 0.0:
            anomaly = t * beta / mu  # 1/r is 1/a on average
        elif eta >= 0.0:
            anomaly = ti.min(anomaly, ti.pow(6.0 * t / mu, 1.0 / 3.0))  # as r ≥ μ X² / 2
    low, high = ti.cast(0.0, float), ti.cast(ti.math.inf, float)
    g1, g2, g3 = ti.cast(0.0, float), ti.cast(0.0, float), ti.cast(0.0, float)
    searching = 1
    count = 0
    while searching == 1:
        count += 1
        square = anomaly * anomaly
        c2, c3 = stumpff(beta * square)
        g3 = c3 * square * anomaly
        g2 = c2 * square
        g1 = anomaly - beta * g3
        g0 = 1.0 - beta * g2
        miss = r * anomaly + eta * g2 + zeta * g3 - t
        slope = r + eta * g1 + zeta * g2
        bend = eta * g0 + zeta * g1
        change = -2.0 * miss * slope / (2.0 * slope * slope - miss * bend)
        size = ti.abs(change)
        turn = size * ti.abs(bend)
        twist = size * size * ti.abs(zeta * g0 - beta * eta * g1)
        if size <= CLOSE * anomaly and turn <= 1e-5 * slope and twist <= 1e-10 * slope:
            # G_n′ = G_(n−1), to third order: the next term is 1e-24 of the first.
            g3 += change * (g2 + change * (0.5 * g1 + change * g0 / 6.0))
            g2 += change * (g1 + change * (0.5 * g0 - change * beta * g1 / 6.0))
            g1 += change * (g0 - change * beta * (0.5 * g1 + change * g0 / 6.0))
            searching = 0
        else:
            if miss < 0.0:
                low = anomaly
            else:
                high = anomaly  # a miss that has overflowed is positive, too
            following = anomaly + change
            if ti.math.isinf(high) == 1:
                following = ti.min(ti.max(following, 1.5 * anomaly), 8.0 * anomaly)
            elif not (low < following and following < high and count < QUICK):
                following = low + 0.5 * (high - low)
                if following <= low or following >= high:
                    searching = 0
            anomaly = following
            if count == MOST:
                searching = -1
    end = r + eta * g1 + zeta * g2
    f = -mu * g2 * inverse
    g = sense * (t - mu * g3)
    slowed = -mu / end
    turned = sense * slowed * g1 * inverse
    slowed *= g2
    return f * x + g * v, turned * x + slowed * v, searching == 0
