"""Motion of masses on damped springs in gravity and drag, by SciPy's DOP853."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import coo_array


def motion(start, *, gravity=(0.0, 0.0, 0.0), drag=0.0, times, stiffness=1.0, tolerance=1e-11):
    """Positions and velocities at the times, (T, N, 3) each; springs are `stiffness` times as stiff as those of the start.

    m a = m g − c_drag v + Σ (D (|d| − L) + c (d/|d|)·Δv) d/|d| over the springs of a mass, on its free axes.
    """
    springs, free, count = start.springs, start.free.astype(float), len(start.mass)
    i, j = springs.between.T
    rows = np.arange(len(i))
    ends = coo_array((np.ones(2 * len(i)), (np.concatenate([j, i]), np.concatenate([rows, rows]))), shape=(count, len(i)))
    ends.data[len(i) :] = -1.0
    ends = ends.tocsr()
    difference = ends.T.tocsr()

    def slope(_, state):
        x, v = state.reshape(2, count, 3)
        d = difference @ x
        length = np.sqrt(np.einsum("ij,ij->i", d, d))
        n = d / length[:, None]
        approach = np.einsum("ij,ij->i", n, difference @ v)
        pull = (stiffness * springs.stiffness * (length - springs.rest_length) + springs.damping * approach)[:, None] * n
        force = start.mass[:, None] * np.asarray(gravity) - drag * v - ends @ pull
        return np.concatenate([(v * free).ravel(), (force / start.mass[:, None] * free).ravel()])

    begin = np.concatenate([start.position.ravel(), (start.velocity * free).ravel()])
    found = solve_ivp(slope, (0.0, times[-1]), begin, "DOP853", t_eval=times, rtol=tolerance, atol=tolerance)
    if not found.success:
        raise RuntimeError(found.message)
    both = found.y.T.reshape(len(times), 2, count, 3)
    return both[:, 0], both[:, 1]
