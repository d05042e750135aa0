"""The direct sum of softened gravity by others, for benchmark_pairs.py: REBOUND's force and a loop compiled by Numba."""

import ctypes

import numpy as np


def rebound_contender(position, mass, softening):
    """One evaluation of the forces by REBOUND (f64, one thread): a call and its result, or None where it is not installed."""
    try:
        import rebound
    except ImportError:
        return None
    simulation = rebound.Simulation()
    simulation.G, simulation.softening = 1.0, softening
    for m, x in zip(mass, position):
        simulation.add(m=m, x=x[0], y=x[1], z=x[2])
    evaluate, where = rebound.clibrebound.reb_simulation_update_acceleration, ctypes.byref(simulation)

    def result():
        evaluate(where)
        return np.array([(p.ax, p.ay, p.az) for p in simulation.particles])

    return lambda: evaluate(where), result


def numba_contender(position, mass, softening, threads):
    """The plain double loop, fastmath and parallel: a call and its result, or None where Numba is not installed."""
    try:
        import numba
    except ImportError:
        return None
    columns = [np.ascontiguousarray(position[:, axis]) for axis in range(3)]
    found = [np.empty_like(mass) for _ in range(3)]
    softening_squared = mass.dtype.type(softening**2)
    numba.set_num_threads(threads)

    @numba.njit(parallel=True, fastmath=True)
    def accelerate(x, y, z, m, ax, ay, az, e2):
        for i in numba.prange(len(m)):
            sx = sy = sz = m[0] * 0
            for j in range(len(m)):
                dx, dy, dz = x[j] - x[i], y[j] - y[i], z[j] - z[i]
                r2 = dx * dx + dy * dy + dz * dz + e2
                w = m[j] / (r2 * np.sqrt(r2))
                sx += w * dx
                sy += w * dy
                sz += w * dz
            ax[i], ay[i], az[i] = sx, sy, sz

    def call():
        accelerate(*columns, mass, *found, softening_squared)

    def result():
        call()
        return np.stack(found, axis=1)

    return call, result
