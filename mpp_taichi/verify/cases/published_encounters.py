"""Published numbers of close encounters and of scattering: Burrau's three bodies, Trojans, alpha particles."""

import math
from functools import cache, partial
from typing import Any

import numpy as np

from mpp_taichi.verify.bounds import grown
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._published import DOUBLE_ONLY, EVERYWHERE, against, bodies, gravity, row
from mpp_taichi.verify.place import Place, sound

ADAPTIVE, TERMS = {"taylor": {"dt": 0.01}}, 20
EIGHTH_ORDER, STAGES = "kahan_li8", 17

# Burrau's three bodies

MASSES = np.array([3.0, 4.0, 5.0])
FIRST, CLOSEST, LATE = 1.8793, 15.8299, 70.0  # shortly before two encounters, and after the ejection
STEPS = 600  # of the adaptive method until the closest approach: 563
BURRAU_GROWTH = {FIRST: 3.5, CLOSEST: 2.6e5}  # of a relative error, by the variational equations in SciPy
SZEBEHELY = "C. Burrau, Astron. Nachr. 195 (1913) 113; V. Szebehely and C. F. Peters, Astron. J. 72 (1967) 876"
IAS15 = "C. Burrau, Astron. Nachr. 195 (1913) 113; computed by IAS15 of REBOUND 5.2 in three frames turned against each other"


@cache
def _burrau(place: Place) -> dict[float, tuple[np.ndarray, np.ndarray]]:
    """Places and velocities, (3, 2) each, at three times."""
    x = [[1, 3], [-2, -1], [1, -1]]
    found = {}
    with place.simulation(gravity(bodies(MASSES, x, np.zeros((3, 2))), ADAPTIVE)) as simulation:
        for time in (FIRST, CLOSEST, LATE):
            simulation.run(until=time)
            sound(simulation)
            now = simulation.snapshot()
            found[time] = now.position[:, :2], now.velocity[:, :2]
    return found


def _pericentre(place: Place, time: float) -> tuple[float, float, float, float]:
    """Of the two heavier bodies after `time`: when and how close by Kepler, and the distance and speed at that time.

    The third body is 2 away: in the 4e-5 left its tide, 3 · 3 r²/2³ at r = 0.01, changes the angular momentum 0.4 by 1e-8.
    """
    position, velocity = _burrau(place)[time]
    x, v, mu = position[2] - position[1], velocity[2] - velocity[1], float(MASSES[1:].sum())
    r, squared = float(np.linalg.norm(x)), float(v @ v)
    spin = float(x[0] * v[1] - x[1] * v[0])
    axis = 1.0 / (2.0 / r - squared / mu)
    eccentricity = math.sqrt(1.0 - spin**2 / (mu * axis))
    anomaly = math.atan2(float(x @ v) / math.sqrt(mu * axis), 1.0 - r / axis)
    past = math.sqrt(axis**3 / mu) * (anomaly - eccentricity * math.sin(anomaly))
    return time - past, axis * (1.0 - eccentricity), r, math.sqrt(squared)


THIRD_BODY = 1e-7  # of the angular momentum and of the energy, ten times the estimate in `_pericentre`


def _approach(time: float, number: int, printed: str, place: Place) -> Found:
    found = _pericentre(place, time)
    off, why = grown(place, steps=STEPS, stages=TERMS, growth=BURRAU_GROWTH[time], span=time)
    if number == 0:
        error = off / found[3] + THIRD_BODY * abs(found[0] - time)  # a place that is off is passed earlier or later
    else:
        sideways = found[3] * off + found[2] * off  # of the angular momentum h = x × v; the distance goes as its square
        spin = math.sqrt(2.0 * float(MASSES[1:].sum()) * found[1])
        error = 2.0 * found[1] * (sideways / spin + THIRD_BODY)
    return against(found[number], printed, error, f"the third body's tide until the pericentre, and {why}")


burrau_first = row(
    __name__, "burrau_first", "Burrau's bodies 4 and 5 first pass each other at t = 1.879343", IAS15,
    partial(_approach, FIRST, 0, "1.879343"),
)  # fmt: skip
burrau_first_distance = row(
    __name__, "burrau_first_distance", "Burrau's bodies 4 and 5 first pass each other at a distance of 0.0097001", IAS15,
    partial(_approach, FIRST, 1, "0.0097001"),
)  # fmt: skip
burrau_closest = row(
    __name__, "burrau_closest", "The closest approach of Burrau's problem is at t = 15.8299", SZEBEHELY,
    partial(_approach, CLOSEST, 0, "15.8299"),
)  # fmt: skip
burrau_closest_distance = row(
    __name__, "burrau_closest_distance", "The closest approach of Burrau's problem is to a distance of 4e-4", SZEBEHELY,
    partial(_approach, CLOSEST, 1, "4e-4"),
)  # fmt: skip


@case(
    "The lightest of Burrau's bodies is thrown out, and the others stay as a pair of semi-major axis 0.55",
    SZEBEHELY,
    on=DOUBLE_ONLY,
)
def burrau_ejection(place: Place) -> Found:
    """The axis at t = 70; an infinite number if the lightest body is still bound."""
    position, velocity = _burrau(place)[LATE]
    pair = MASSES[1:] / MASSES[1:].sum()
    far, fast = position[0] - pair @ position[1:], velocity[0] - pair @ velocity[1:]
    if 0.5 * float(fast @ fast) < MASSES.sum() / float(np.linalg.norm(far)):
        return Found(math.inf, 0.0, "the lightest body has to be faster than the speed of escape")
    x, v = position[2] - position[1], velocity[2] - velocity[1]
    axis = 1.0 / (2.0 / float(np.linalg.norm(x)) - float(v @ v) / float(MASSES[1:].sum()))
    return against(
        axis, "0.55", 2e-4, "the spread of IAS15 of REBOUND 5.2 in three frames turned against each other, 0.5524 to 0.5526"
    )


# Trojans

JUPITER = 9.53875e-4  # of the mass of Sun and Jupiter
SHIFT = 3e-6  # of the bodies from L4, of the distance of Jupiter
TROJAN_STEPS, TROJAN_TIME, TROJAN_GROWTH = 200, 3.0, 12.0
DIRECTIONS = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [1, 1, 1, 0], [-1, 1, 0, 1]])
"""Displacements of places and velocities, (x, y, u, w)."""


@cache
def _trojan_frequencies(place: Place) -> tuple[np.ndarray, np.ndarray]:
    """The two frequencies about L4 in Jupiter's, and their errors, from massless bodies beside L4 as a linear map.

    Bodies are displaced to both sides along four directions of the plane's phase space. The map from the displacements at the
    start to the displacements at the time τ has the eigenvalues exp(± i ω τ), in the frame that turns. Even terms cancel;
    the cubes are taken away by a second set of bodies, twice as far, and what they took away is the error.
    """
    l4, turn = np.array([0.5 - JUPITER, math.sqrt(0.75)]), np.array([[0.0, -1.0], [1.0, 0.0]])
    moved = np.repeat(DIRECTIONS, 2, axis=0) * np.tile([SHIFT, -SHIFT], 4)[:, None]
    moved = np.concatenate([moved, 2.0 * moved])
    x = np.array([[-JUPITER, 0.0], [1.0 - JUPITER, 0.0], *(l4 + moved[:, :2])])
    v = x @ turn.T
    v[2:] += moved[:, 2:]
    mass = [1.0 - JUPITER, JUPITER, *[0.0] * len(moved)]
    scene = gravity(bodies(mass, x, v), {EIGHTH_ORDER: {"dt": TROJAN_TIME / TROJAN_STEPS}})
    with place.simulation(scene) as simulation:
        simulation.run(steps=TROJAN_STEPS)
        sound(simulation)
        end, time = simulation.snapshot(), simulation.time
    c, s = math.cos(time), math.sin(time)
    back = np.array([[c, s], [-s, c]])
    x, v = end.position[2:, :2] @ back.T, end.velocity[2:, :2] @ back.T
    state = np.concatenate([x, v - x @ turn.T], axis=1)
    near, far = (
        np.sort(np.abs(np.angle(np.linalg.eigvals((part[0::2] - part[1::2]).T / (2.0 * shift) @ np.linalg.inv(DIRECTIONS.T)))))
        for part, shift in ((state[:8], SHIFT), (state[8:], 2.0 * SHIFT))
    )
    found = (near + (near - far) / 3.0) / time
    return found[[0, 3]], np.abs(far - near)[[0, 3]] / time


def _trojan(number: int, printed: str, place: Place) -> Found:
    found, cubes = _trojan_frequencies(place)
    off, why = grown(place, steps=TROJAN_STEPS, stages=STAGES, growth=TROJAN_GROWTH, span=TROJAN_TIME)
    # An eigenvalue exp(iα) with its conjugate beside it is off by the map's error over sin α, as the sum of both is real.
    error = off / SHIFT / (TROJAN_TIME * abs(math.sin(float(printed) * TROJAN_TIME)))
    words = f"the cubes of displacements of {SHIFT:g}, and, over the displacement, {why}"
    return against(float(found[number]), printed, float(cubes[number]) + error, words)


ROUTH = (
    "M. Gascheau (1843); E. J. Routh, Proc. Lond. Math. Soc. 6 (1875) 86: 2 ω² = 1 ± √(1 − 27 μ (1 − μ)), with Jupiter's "
    "μ = 0.000953875 as in C. D. Murray and S. F. Dermott, Solar System Dynamics (1999) §3.7"
)
trojan_slow = row(
    __name__, "trojan_slow", "A Trojan librates about L4 at 0.0804639 of Jupiter's frequency", ROUTH,
    partial(_trojan, 0, "0.0804639"),
)  # fmt: skip
trojan_fast = row(
    __name__, "trojan_fast", "A Trojan has its epicycles at 0.9967575 of Jupiter's frequency", ROUTH,
    partial(_trojan, 1, "0.9967575"),
)  # fmt: skip

# Alpha particles

ALPHA_STEPS = 400


def _repelled(charge: float, x: list[float], v: list[float], span: float) -> dict[str, Any]:
    """A charge of mass 1 in the field of a fixed charge of the same sign, with a product of charges; r and v at the start."""
    fixed = {"body": {"mass": 1.0, "charge": charge, "position": [0.0, 0.0], "free": False}}
    moving = {"body": {"mass": 1.0, "charge": 1.0, "position": x, "velocity": v}}
    integrator = {EIGHTH_ORDER: {"dt": span / ALPHA_STEPS}}
    return {"dimensions": 2, "particles": [fixed, moving], "forces": [{"coulomb": {}}], "integrator": integrator}


@case(
    "Coulomb's force turns a particle by 90° if it aims beside the centre by k q Q / m v²",
    "E. Rutherford, Phil. Mag. 21 (1911) 669: cot θ/2 = m v² b / k q Q",
    quick=True,
    **EVERYWHERE,
)
def rutherford(place: Place) -> Found:
    """One half of the hyperbola, from its vertex on; the direction at infinity by the hyperbola's own tangent."""
    root, span = math.sqrt(2.0), 20.0
    closest = 1.0 + root  # with k q Q = m = v = 1: b = 1, e = √2, and the speed there is b v / r
    with place.simulation(_repelled(1.0, [closest, 0.0], [0.0, 1.0 / closest], span)) as simulation:
        simulation.run(steps=ALPHA_STEPS)
        sound(simulation)
        v, time = simulation.snapshot().velocity[1], simulation.time
    h = math.asinh(time / root)
    for _ in range(100):
        h -= (root * math.sinh(h) + h - time) / (root * math.cosh(h) + 1.0)
    angle = 180.0 - 2.0 * math.degrees(math.atan2(v[1] * math.tanh(h), v[0]))
    bound, why = grown(place, steps=ALPHA_STEPS, stages=STAGES, growth=2.0, span=span)
    return against(angle, "90.0000000000000", 2.0 * math.degrees(bound), f"errors of the speed double on the way out; {why}")


@case(
    "An alpha particle of 7.69 MeV turns back 29.6 fm before a nucleus of gold",
    "H. Geiger and E. Marsden, Phil. Mag. 25 (1913) 604, by energy: 2 · 79 · 1.43996 MeV fm / 7.69 MeV",
    **EVERYWHERE,
)
def alpha_on_gold(place: Place) -> Found:
    """Head-on from 400 fm until the time of the turning point, r = a (1 + cosh η), t = √(a³/k) (η + sinh η), 2 a = k/E."""
    energy, product, start = 7.69, 2.0 * 79.0 * 1.43996, 400.0  # in MeV and fm: with a mass of 1 the speed is √(2 E)
    axis = 0.5 * product / energy
    eta = math.acosh(start / axis - 1.0)
    span = math.sqrt(axis**3 / product) * (eta + math.sinh(eta))
    speed = math.sqrt(2.0 * (energy - product / start))
    with place.simulation(_repelled(product, [start, 0.0], [-speed, 0.0], span)) as simulation:
        simulation.run(steps=ALPHA_STEPS)
        sound(simulation)
        least = float(simulation.snapshot().position[1, 0])
    bound, why = grown(place, steps=ALPHA_STEPS, stages=STAGES, growth=2.0, span=span * speed / start)
    return against(least, "29.6", start * bound, f"of 400 fm at the start; {why}")
