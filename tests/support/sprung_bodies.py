"""Two bodies with gravity and a spring, as a scene and computed by NumPy alone, by the formulas of the textbook."""

import numpy as np

MASS = np.array([1.0, 0.5])
PLACES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
VELOCITIES = np.array([[0.0, 0.0, 0.0], [0.0, 1.2, 0.0]])
STRENGTH, STIFFNESS, LENGTH = 1.0, 0.5, 1.0
DT, STEPS = 0.125, 16

ROUNDING = 1e-12
"""A bound of the difference of two computations of the same sixteen steps in f64.

A step has some 30 roundings of 1.1·10⁻¹⁶ of numbers of size 1, and an error grows in the two units of time by less than
exp(1.23 · 2) = 12, at the rate of the fastest motion, the spring's: 16 · 30 · 1.1·10⁻¹⁶ · 12 = 6·10⁻¹³.
"""

SCENE = {
    "title": "Two bodies",
    "units": {"length": "AU", "time": "day", "mass": "Msun"},
    "particles": [
        {"body": {"name": name, "mass": float(m), "position": x.tolist(), "velocity": v.tolist()}}
        for name, m, x, v in zip(("sun", "earth"), MASS, PLACES, VELOCITIES)
    ],
    "springs": [{"link": {"between": ["sun", "earth"], "stiffness": STIFFNESS, "rest_length": LENGTH}}],
    "forces": [{"newtonian_gravity": {"strength": STRENGTH}}],
    "integrator": {"leapfrog": {"dt": DT}},
    "run": {"duration": DT * STEPS},
    "record": {"size": [64, 48], "fps": 2, "seconds": 1},
    "expect": {"relative_energy_error_max": {"below": 1.0}},
}


def accelerations(places):
    """Of gravity, G m/r², and of the spring, D (r − L)/m, along the line between the bodies."""
    apart = places[1] - places[0]
    r = np.linalg.norm(apart)
    pull = STRENGTH * MASS[0] * MASS[1] / r**2 + STIFFNESS * (r - LENGTH)
    return np.outer([pull / MASS[0], -pull / MASS[1]], apart / r)


def flight(field=(0.0, 0.0, 0.0), *, steps=STEPS, dt=DT):
    """Places and velocities at the start and after each step of leapfrog: half a drift, a kick, half a drift."""
    places, velocities = PLACES.copy(), VELOCITIES.copy()
    found = [(places, velocities)]
    for _ in range(steps):
        middle = places + 0.5 * dt * velocities
        velocities = velocities + dt * (accelerations(middle) + np.array(field))
        places = middle + 0.5 * dt * velocities
        found.append((places, velocities))
    return found


def energies(places, velocities, field=(0.0, 0.0, 0.0)):
    """Kinetic and potential energy."""
    r = np.linalg.norm(places[1] - places[0])
    kinetic = 0.5 * float(MASS @ np.sum(velocities**2, axis=1))
    pairs = -STRENGTH * MASS[0] * MASS[1] / r + 0.5 * STIFFNESS * (r - LENGTH) ** 2
    return kinetic, pairs - float(MASS @ (places @ np.array(field)))


def conserved_errors(field=(0.0, 0.0, 0.0)):
    """The largest errors of energy, momentum, angular momentum and centre of mass over the run, as the documents define them.

    The energy over its first value; momentum and angular momentum over the largest sums of m |v| and of m |x| |v|, seen up to
    this moment; the centre of mass against uniform motion, over the largest distance from it at the start.
    """
    states = flight(field)
    first = [np.asarray(each) for each in _sums(*states[0])]
    radius = np.linalg.norm(PLACES - MASS @ PLACES / MASS.sum(), axis=1).max()
    most, worst = np.zeros(2), np.zeros(4)
    for number, (places, velocities) in enumerate(states):
        momentum, spin, center = _sums(places, velocities)
        speeds = MASS * np.linalg.norm(velocities, axis=1)
        most = np.maximum(most, [speeds.sum(), (speeds * np.linalg.norm(places, axis=1)).sum()])
        uniform = first[2] + first[0] / MASS.sum() * DT * number
        start = sum(energies(*states[0], field))
        here = [
            abs(sum(energies(places, velocities, field)) / start - 1.0),
            np.linalg.norm(momentum - first[0]) / most[0],
            np.linalg.norm(spin - first[1]) / most[1],
            np.linalg.norm(center - uniform) / radius,
        ]
        worst = np.maximum(worst, here)
    return dict(zip(("relative_energy", "momentum", "angular_momentum", "center_of_mass"), worst.tolist()))


def _sums(places, velocities):
    """Momentum, angular momentum and centre of mass."""
    return MASS @ velocities, MASS @ np.cross(places, velocities), MASS @ places / MASS.sum()


def frequencies():
    """Of the small oscillations of the spring as placed: roots of the eigenvalues of the stiffness over the masses."""
    along = np.zeros((6, 6))
    for a, b, sign in ((0, 0, 1.0), (3, 3, 1.0), (0, 3, -1.0), (3, 0, -1.0)):
        along[a, b] = sign * STIFFNESS
    root = np.repeat(1.0 / np.sqrt(MASS), 3)
    return np.sqrt(np.clip(np.linalg.eigvalsh(along * np.outer(root, root)), 0.0, None))
