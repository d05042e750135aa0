"""Simultaneous impact of touching spheres, in NumPy: generalized reflections with SciPy's non-negative least squares.

Source: Smith, Kaufman, Vouga, Tamstorf, Grinspun, ACM Transactions on Graphics 31 (2012) 106.
"""

import numpy as np
from scipy.optimize import nnls
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


def jacobian(pairs, normals, count):
    """Row c gives the separating speed n·(v_i − v_j) of contact c from all velocities, (m, count * d); j = −1 is at rest."""
    m, d = normals.shape
    rows = np.zeros((m, count, d))
    for c, (i, j) in enumerate(pairs):
        rows[c, i] += normals[c]
        if j >= 0:
            rows[c, j] -= normals[c]
    return rows.reshape(m, count * d)


def resolve(velocity, inverse_mass, pairs, normals, restitution, *, threshold=1e-13, limit=100_000):
    """Velocities after the impact, and the number of waves."""
    count, d = velocity.shape
    rows = jacobian(pairs, normals, count)
    root = np.sqrt(inverse_mass[:, :d]).ravel()
    v = velocity.ravel().copy()
    free = root > 0
    for wave in range(limit):
        speed = rows @ v
        violated = np.flatnonzero(speed < -threshold * np.abs(v).max())
        if not len(violated):
            return v.reshape(count, d), wave
        scaled = rows[violated] * root
        linked = coo_matrix((np.abs(scaled) @ np.abs(scaled.T)) > 0)
        parts, part = connected_components(linked, directed=False)
        change = np.zeros_like(v)
        for p in range(parts):
            mine = part == p
            target = np.zeros_like(v)
            columns = scaled[mine].T
            involved = (np.abs(columns).sum(axis=1) > 0) & free
            # λ ≥ 0 that brings v closest to where none of these contacts approaches, in the metric of the kinetic energy
            target[involved] = -v[involved] / root[involved]
            goal = columns @ np.linalg.lstsq(columns.T @ columns, -speed[violated[mine]], rcond=None)[0]
            impulse, _ = nnls(columns, goal)
            approach = impulse * -speed[violated[mine]]
            e = (approach @ restitution[violated[mine]]) / approach.sum()
            change += (1 + e) * root * (columns @ impulse)
        v = v + change
    raise RuntimeError("no end")
