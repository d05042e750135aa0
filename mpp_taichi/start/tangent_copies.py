"""Tangent copies: how many copies of a system a run moves so that its quantities have the derivatives that they need."""

import numpy as np

from mpp_taichi.scene.asked_quantities import derivative_quantities
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot


def copies_of(spec: SceneSpec, start: Snapshot) -> int:
    """One; with a quantity that needs the whole derivative also one for each free component of a position or velocity."""
    free = np.count_nonzero(np.asarray(start.free)[:, : spec.dimensions])
    return 1 + 2 * int(free) if derivative_quantities(spec) else 1
