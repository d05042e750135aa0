"""Starts of periodic orbits that are their own mirror images: the criss-cross of three bodies and the double double star.

    python tools/make/find_mirror_orbits.py

With G = 1, masses of 1 and the period 2π, all bodies begin on the x axis and move along y. If they all cross the axis at right
angles again after half a period, the second half is the mirror image of the first, and the orbit closes (Roy and Ovenden 1955).
A guess of the places and speeds goes to the zero of the half period's y and x velocities by Newton's method, over SciPy's
DOP853. In the double double star the second pair is the first, turned by half a turn about the origin.

Printed are the constants of the scenes criss_cross and double_double; the error with which the orbit returns after 2π; and the
largest size of a multiplier, by which a displacement grows in a period: 1 where the orbit is linearly stable.

Sources: Vanderbei, New orbits for the n-body problem, Ann. New York Acad. Sci. 1017 (2004) 422, found both by least action;
Hénon, Celestial Mechanics 13 (1976) 267, and Moore and Nauenberg, J. Comput. Nonlinear Dynam. 1 (2006) 307, the criss-cross.
"""

import argparse
import sys

import numpy as np
from find_choreographies import motion
from scipy.integrate import solve_ivp
from scipy.optimize import root

PERIOD = 2.0 * np.pi
SHIFT = 1e-6  # of a coordinate, in the differences that give the multipliers


def criss_cross(places, speeds):
    """Three bodies about their centre of mass: the third has what the first two leave."""
    return np.append(places, -sum(places)), np.append(speeds, -sum(speeds))


def double_double(places, speeds):
    """A pair on the right, and the same pair turned by half a turn."""
    return np.concatenate([places, -np.asarray(places)]), np.concatenate([speeds, -np.asarray(speeds)])


# A pair has ten inner turns in a period, against the turn of the pairs. Separations d by Kepler's third law, speeds ω d/2.
OUTER, INNER = 4.0 ** (1 / 3), (2.0 / 100.0) ** (1 / 3)
ORBITS = {
    "criss_cross": (criss_cross, [1.076, -0.071], [0.195, -1.232]),
    "double_double": (
        double_double,
        [(OUTER + INNER) / 2, (OUTER - INNER) / 2],
        [OUTER / 2 - 10 * INNER / 2, OUTER / 2 + 10 * INNER / 2],
    ),
}


def state_of(places, speeds):
    """All bodies on the x axis, moving along y."""
    return np.concatenate([np.stack([places, 0 * places], axis=1).ravel(), np.stack([0 * speeds, speeds], axis=1).ravel()])


def after(state, time):
    """The state after a time."""
    return solve_ivp(motion, (0.0, time), state, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]


def largest_multiplier(state):
    """The largest size of an eigenvalue of the derivative of the end of a period after its start."""
    shifts = SHIFT * np.eye(len(state))
    columns = [(after(state + shift, PERIOD) - after(state - shift, PERIOD)) / (2 * SHIFT) for shift in shifts]
    return np.abs(np.linalg.eigvals(np.stack(columns, axis=1))).max()


def main():
    """Find, check and print."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    for name, (of, places, speeds) in ORBITS.items():

        def miss(unknown, of=of):
            position, velocity = after(state_of(*of(unknown[:2], unknown[2:])), PERIOD / 2).reshape(2, -1, 2)
            return [*position[:2, 1], *velocity[:2, 0]]

        found = root(miss, [*places, *speeds], tol=1e-14)
        state = state_of(*of(found.x[:2], found.x[2:]))
        error = np.abs(after(state, PERIOD) - state).max()
        print(f"{name}: misses the axis by {np.abs(found.fun).max():.1e}, return error {error:.1e}")
        print(f"  largest multiplier {largest_multiplier(state):.4f}")
        for x, v in zip(*of(found.x[:2], found.x[2:])):
            print(f"  x {x:+.17f}  speed {v:+.17f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
