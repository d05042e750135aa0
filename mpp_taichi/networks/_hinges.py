"""Hinges: bending stiffness of three particles in a row, as springs without a rest length."""

import numpy as np

from mpp_taichi.errors import PlacementError
from mpp_taichi.networks._base import NetworkContext
from mpp_taichi.snapshot import Springs


def hinge_springs(rows: np.ndarray, context: NetworkContext, *, bending_stiffness: float, color: tuple) -> Springs:
    """The springs of hinges at the second particle of each row (i, j, k), shape (hinge_count, 3).

    With the lengths p and q of the two links at rest and the bending stiffness B [force length²] a hinge has the energy

        V = B/(p + q) |(x_k − x_j)/q − (x_j − x_i)/p|²,

    which is ½ B κ² times the length (p + q)/2, for the curvature κ = |t_k − t_i| / ((p + q)/2) of a chain whose links keep
    their lengths; t are the directions of the links. |Σ w x|² with Σ w = 0 is −Σ w_a w_b |x_a − x_b|² over the pairs, so that
    V is the energy of three springs without a rest length: stiff along both links, of negative stiffness between the
    outer particles. Turning the whole chain costs no energy. For equal links it is the second difference of beam theory.
    Springs between the same particles become one spring.

    Raises:
        PlacementError: two particles of a row are at one place at rest.
    """
    count = len(rows)
    i, j, k = rows.T
    p, q = (np.linalg.norm(context.rest_position[b] - context.rest_position[a], axis=1) for a, b in ((i, j), (j, k)))
    if count and not min(p.min(), q.min()) > 0.0:
        raise PlacementError("a hinge needs three particles at three places")
    weights = {"i": 1.0 / p, "j": -(1.0 / p + 1.0 / q), "k": 1.0 / q}
    scale = -2.0 * bending_stiffness / (p + q)
    pairs = ((i, j, "i", "j"), (j, k, "j", "k"), (i, k, "i", "k"))
    between = np.sort(np.concatenate([np.stack(each[:2], axis=1) for each in pairs]), axis=1)
    stiffness = np.concatenate([scale * weights[a] * weights[b] for _, _, a, b in pairs])
    ends, number = np.unique(between, axis=0, return_inverse=True)
    nothing = np.zeros(len(ends))
    return Springs(
        between=ends.astype(np.int32),
        stiffness=np.bincount(number.ravel(), stiffness, len(ends)),
        damping=nothing,
        rest_length=nothing,
        color=np.array(np.broadcast_to(np.asarray(color, dtype=float), (len(ends), 3))),
    )
