"""Starts of chain choreographies, on which N equal bodies follow one another on a curve of N − 1 loops in a row (Simó 2001).

    python tools/make/find_choreographies.py [--bodies 4 5]

With G = 1, masses of 1 and the period 2π, the curve is a series of sines and cosines, x odd about its middle. Its
coefficients begin as those of a Lissajous figure, go down to the least action, and then to the zero of the equation of motion
by Newton's method: q″ = Σ (q_k − q)/|q_k − q|³, where q_k(t) = q(t + 2π k/N). The orbit is then integrated for a period with
SciPy's DOP853, and its end is compared with its start: DOP853's own errors of 1e-15 grow by up to 2e5 until then. The numbers
that are printed are the constants of the scenes super_eight and chain_of_five.

Source: Simó, New families of solutions in N-body problems, European Congress of Mathematics (2001) 101; Gerver's super-eight.
"""

import argparse
import sys

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize, root

TERMS = 150  # of each coordinate; over them the coefficients fall to the rounding error of a float64
POINTS = 8  # of the shortest wave


class Curve:
    """A closed curve of N bodies, given by its coefficients."""

    def __init__(self, bodies: int) -> None:
        loops = bodies - 1
        self.bodies, self.even = bodies, loops % 2 == 0
        self.of_x = 1.0 + 2.0 * np.arange(TERMS)
        self.of_y = 2.0 + 2.0 * np.arange(TERMS) if self.even else self.of_x
        count = bodies * POINTS * TERMS // 2
        self.times = 2.0 * np.pi * np.arange(count) / count
        self.turn = count // bodies  # points from a body to the next
        self.wave_x, self.wave_y = self._waves(self.times)

    def _waves(self, times):
        y = np.outer(times, self.of_y)
        return np.sin(np.outer(times, self.of_x)), np.sin(y) if self.even else np.cos(y)

    def guess(self):
        """x = a sin t and y = b sin (N − 1) t, or b cos (N − 1) t: a Lissajous figure of N − 1 loops."""
        found = np.zeros(2 * TERMS)
        found[0] = 1.3
        found[TERMS + np.flatnonzero(self.of_y == self.bodies - 1)[0]] = 0.35
        return found

    def places(self, c):
        """Positions along the curve, (2, points)."""
        return np.stack([self.wave_x @ c[:TERMS], self.wave_y @ c[TERMS:]])

    def residual(self, c):
        """The projections of pull − q″ on every wave: the gradient of the action, with its sign changed."""
        place = self.places(c)
        pull = np.zeros_like(place)
        for k in range(1, self.bodies):
            way = np.roll(place, -k * self.turn, axis=1) - place
            pull += way / np.sqrt((way**2).sum(axis=0)) ** 3
        share = 2.0 / len(self.times)
        x = share * (self.wave_x.T @ pull[0]) + self.of_x**2 * c[:TERMS]
        y = share * (self.wave_y.T @ pull[1]) + self.of_y**2 * c[TERMS:]
        return np.concatenate([x, y])

    def action(self, c):
        """The action of a body in a period and its gradient, per π."""
        place = self.places(c)
        potential = 0.0
        for k in range(1, self.bodies):
            way = np.roll(place, -k * self.turn, axis=1) - place
            potential += 0.5 * (1.0 / np.sqrt((way**2).sum(axis=0))).mean()
        squares = np.concatenate([self.of_x, self.of_y]) ** 2
        return 0.5 * (squares * c**2).sum() + 2.0 * potential, self.residual(c)

    def start(self, c):
        """Positions and velocities of all bodies, (N, 4)."""
        times = 2.0 * np.pi * np.arange(self.bodies) / self.bodies
        x, y = np.outer(times, self.of_x), np.outer(times, self.of_y)
        rise = np.cos(y) if self.even else -np.sin(y)
        columns = self._waves(times)
        return np.stack(
            [
                *(wave @ part for wave, part in zip(columns, (c[:TERMS], c[TERMS:]))),
                np.cos(x) @ (self.of_x * c[:TERMS]),
                rise @ (self.of_y * c[TERMS:]),
            ],
            axis=1,
        )


def motion(_time, state):
    """Rates of positions and velocities of equal bodies."""
    place, velocity = state.reshape(2, -1, 2)
    way = place[None] - place[:, None]
    square = (way**2).sum(axis=2)
    np.fill_diagonal(square, np.inf)
    return np.concatenate([velocity.ravel(), (way / square[..., None] ** 1.5).sum(axis=1).ravel()])


def main():
    """Find, check and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bodies", type=int, nargs="+", default=[4, 5])
    for bodies in parser.parse_args().bodies:
        curve = Curve(bodies)
        least = minimize(curve.action, curve.guess(), jac=True, method="L-BFGS-B", options={"maxiter": 5000, "maxfun": 9000})
        found = root(curve.residual, least.x, tol=1e-15)
        start = curve.start(found.x)
        state = np.concatenate([start[:, :2].ravel(), start[:, 2:].ravel()])
        end = solve_ivp(motion, (0.0, 2.0 * np.pi), state, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
        print(f"{bodies} bodies: action {least.fun:.6f}, last coefficients {np.abs(found.x[[TERMS - 1, -1]])}")
        print(f"  equation {np.abs(curve.residual(found.x)).max():.1e}, return error {np.abs(end - state).max():.1e}")
        for number, row in enumerate(start):
            print(f"  body {number}: " + "  ".join(f"{value:+.17f}" for value in row))
    return 0


if __name__ == "__main__":
    sys.exit(main())
