"""The double pendulum of the scenes with its stiff spring replaced by a rigid rod, by SciPy."""

import numpy as np
from scipy.integrate import solve_ivp

ANCHOR = np.array([0.0, 1.0])


def end_positions(first, second, stiffness, gravity, time):
    """Places of two masses of 1, from rest: the first on a rod of length 1, the second on a spring of length 1."""
    start = np.arctan2(first[0] - ANCHOR[0], ANCHOR[1] - first[1])

    def slopes(_, y):
        angle, turning, second, velocity = y[0], y[1], y[2:4], y[4:6]
        at = ANCHOR + [np.sin(angle), -np.cos(angle)]
        along = np.array([np.cos(angle), np.sin(angle)])
        separation = second - at
        length = np.linalg.norm(separation)
        pull = stiffness * (length - 1.0) * separation / length
        return np.concatenate([[turning, (pull + gravity) @ along], velocity, gravity - pull])

    end = solve_ivp(slopes, (0.0, time), [start, 0.0, *second, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return np.array([ANCHOR + [np.sin(end[0]), -np.cos(end[0])], end[2:4]])
