"""First contact of bodies in free flight: when a distance first is ≤ 0 while it shrinks, without cancellation."""

import taichi as ti

from mpp_taichi.types import Template

# Halvings until no float lies between two floats: 1 sign, 11 exponent and 52 mantissa bits halve within 64 + 53 steps.
HALVINGS = 128


@ti.func
def first_contact(gap, speed, acceleration, horizon):
    """First s in 0 … horizon at which gap + speed s + acceleration s² / 2 is ≤ 0 and shrinks, else infinity.

    An overlapping pair (gap < 0) that recedes but is pulled back meets again at the gap 0, or, if the way there takes more than
    half of the energy of its motion, at the gap of now. Round-off leaves such gaps after a contact; a contact at the gap 0, or
    at the turning point, would take all energy of a slow bounce, and the time would not go on.
    """
    result = ti.math.inf
    discriminant = speed * speed - 2 * acceleration * gap
    if speed < 0:
        if gap <= 0:
            result = 0.0
        elif discriminant >= 0:
            result = 2 * gap / (ti.sqrt(discriminant) - speed)
    elif acceleration < 0:
        result = time_of_return(speed, acceleration, discriminant)
    return result if result <= horizon else ti.math.inf


@ti.func
def time_of_return(speed, acceleration, square):
    """Time until the gap is 0 again, with the speed −√square, or, if this is less than half of the energy, the gap of now."""
    return (speed + ti.sqrt(square if 2 * square >= speed * speed else speed * speed)) / -acceleration


@ti.func
def first_contact_curved(q, u, reach, inside: Template, horizon):
    """First s in 0 … horizon at which |q + u s| crosses `reach` outwards (inside) or inwards (not inside), else infinity.

    The discriminant is computed from reach² − (the part of q across u)², which keeps a grazing contact's digits from far away.
    """
    result = ti.math.inf
    a, b, c = u.norm_sqr(), q.dot(u), q.norm_sqr() - reach * reach
    if ti.static(inside):
        if a > 0:
            across = q - u * (b / a)
            root = ti.sqrt(ti.max(a * (reach * reach - across.norm_sqr()), 0))
            if b <= 0:
                result = (root - b) / a
            elif c >= 0:
                result = 0.0
            else:
                result = -c / (root + b)
    elif b < 0:
        if c <= 0:
            result = 0.0
        else:
            across = q - u * (b / a)
            discriminant = a * (reach * reach - across.norm_sqr())
            if discriminant > 0:
                result = c / (ti.sqrt(discriminant) - b)
    return result if result <= horizon else ti.math.inf


@ti.func
def first_contact_falling(q, u, a, reach, inside: Template, horizon):
    """The first contact along q + u s + a s² / 2, where the squared distance is a quartic in s.

    Spheres that overlap and recede meet again where they are as near as they are now (see `first_contact`).
    The quartic is split at the roots of its derivative, which are split at the roots of the next, so no contact is missed
    and every search is a bracketed one.
    """
    sign = ti.static(-1 if inside else 1)
    c4, c3 = sign * a.norm_sqr() / 4, sign * u.dot(a)
    c2, c1 = sign * (u.norm_sqr() + q.dot(a)), sign * 2 * q.dot(u)
    c0 = sign * (q.norm_sqr() - reach * reach)
    if c1 > 0:
        c0 = ti.max(c0, 0.0)
    result = ti.math.inf
    if c4 == 0:
        result = first_contact_curved(q, u, reach, inside, horizon)
    else:
        end = ti.min(horizon, _root_bound(c4, c3, c2, c1, c0))
        knots = _turning_points(4 * c4, 3 * c3, 2 * c2, c1, end)
        found = False
        start = 0.0
        low = c0
        for k in ti.static(range(4)):
            stop = knots[k]
            high = c0 + stop * (c1 + stop * (c2 + stop * (c3 + stop * c4)))
            shrinks = high < low
            if ti.static(k == 0):
                shrinks = c1 < 0 or (c1 == 0 and high < low)
            if not found and shrinks and (stop > start or k == 0):
                if low <= 0:
                    result = start
                    found = True
                elif high <= 0:
                    result = _bracketed_root(c4, c3, c2, c1, c0, start, stop)
                    found = True
            start = stop
            low = high
    return result if result <= horizon else ti.math.inf


@ti.func
def _root_bound(c4, c3, c2, c1, c0):
    """No real root of the quartic is larger. Source: Fujiwara, Tôhoku Math. J. 10 (1916) 167."""
    third = 1.0 / 3.0
    bound = ti.max(ti.abs(c3 / c4), ti.sqrt(ti.abs(c2 / c4)))
    return 2 * ti.max(bound, ti.max(ti.abs(c1 / c4) ** third, ti.sqrt(ti.sqrt(ti.abs(c0 / (2 * c4))))))


@ti.func
def _turning_points(c3, c2, c1, c0, end):
    """Roots of a cubic in 0 … end, ascending, as three numbers and then `end`; an absent root is `end`."""
    # Where the cubic's slope 3 c3 s² + 2 c2 s + c1 vanishes.
    first, second = end * 0, end * 0
    square = c2 * c2 - 3 * c3 * c1
    if square > 0:
        w = -(c2 + (ti.sqrt(square) if c2 >= 0 else -ti.sqrt(square)))
        one = w / (3 * c3)
        other = c1 / w if w != 0 else one
        first = ti.math.clamp(ti.min(one, other), 0, end)
        second = ti.math.clamp(ti.max(one, other), 0, end)
    edges = ti.Vector([end * 0, first, second, end])
    knots = ti.Vector([end, end, end, end])
    count = 0
    for k in ti.static(range(3)):
        start, stop = edges[k], edges[k + 1]
        low = c0 + start * (c1 + start * (c2 + start * c3))
        high = c0 + stop * (c1 + stop * (c2 + stop * c3))
        if stop > start and ((low < 0) != (high < 0)):
            root = _bracketed_root(0.0, c3, c2, c1, c0, start, stop)
            for m in ti.static(range(3)):
                if m == count:
                    knots[m] = root
            count += 1
    return knots


@ti.func
def _bracketed_root(c4, c3, c2, c1, c0, start, stop):
    """A root between start and stop, at which the polynomial has opposite signs: Newton's steps, halvings where they leave."""
    low, high = start, stop
    falls = c0 + low * (c1 + low * (c2 + low * (c3 + low * c4))) > 0
    s = (low + high) / 2
    for _ in range(HALVINGS):
        value = c0 + s * (c1 + s * (c2 + s * (c3 + s * c4)))
        slope = c1 + s * (2 * c2 + s * (3 * c3 + s * 4 * c4))
        if (value > 0) == falls:
            low = s
        else:
            high = s
        step = s - value / slope if slope != 0 else low
        next_s = step if low < step and step < high else (low + high) / 2
        if next_s == s or not (low < next_s and next_s < high):
            break
        s = next_s
    return s
