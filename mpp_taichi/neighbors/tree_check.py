"""Tree check: whether the accelerations of a walk keep the accuracy, and which groups of bodies have to walk again.

The limit of a group comes from an estimate of its field, before any acceleration is known. Where pulls cancel, as between
the two halves of a row of bodies, the acceleration a of a body is weaker than the estimate, and the permitted errors add up to
more than the accuracy η times |a|. Therefore each walk also adds up the variance E² of its errors (tree_estimate.py). A body
misses the accuracy with the probability of a normal error in a plane,

    P = exp(−(η |a| / E)²).

If the mean of P over all bodies is above `SHARE`, each group whose own mean is above `SHARE` walks again, with a limit at which
E is η |a| / `MARGIN` for the weakest acceleration of the group. The new limit is lower than the limit before. This is repeated
until no group has a mean above `SHARE` and a limit above the lowest, `TreeEstimate.least`. Bodies among which few pulls cancel,
as in Plummer's sphere, walk once.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.rough_functions import rough_exponential, rough_power
from mpp_taichi.neighbors.tree_estimate import GROUP

SHARE = 0.005  # half of the share of bodies that may miss the accuracy: E is known to a factor of two
MARGIN = 4.0  # in rows of bodies, where few nodes cause the error, one error in a hundred is above 3 E
EXPONENT = 10.0 / 7.0  # an error goes with the power 7/10 of the limit, or with a higher power (tree.py)
PARTS = 64  # of a probability: a sum of whole numbers does not depend on the threads


@ti.data_oriented
class TreeCheck:
    """The check of the accelerations that a walk found, against the variances that the walk left."""

    def __init__(self, order: Any, estimate: Any, total: Any) -> None:
        """Take the TreeOrder, the TreeEstimate and the accelerations by slot, (padded_count × dimensions,), of the walk."""
        self.order, self.estimate, self.total = order, estimate, total

    def repeat(self, walk: Any, accuracy: float) -> None:
        """Walk again, where needed, by calls of `walk`."""
        allowed = SHARE * PARTS * self.order.particle_count
        while self._lower_limits(accuracy) > allowed:
            walk()
            allowed = 0.0

    @ti.kernel
    def _lower_limits(self, accuracy: float) -> ti.i32:
        """Set which groups are to walk again, with which limits; return the sum of P over these groups, in parts."""
        parts = 0
        for group in range(self.estimate.group_count):
            begin, end = group * GROUP, ti.min((group + 1) * GROUP, self.order.particle_count)
            variance = self.estimate.variance[group]
            weakest = ti.math.inf
            probability = 0.0
            for slot in range(begin, end):
                squared = 0.0
                for axis in ti.static(range(self.order.dimensions)):
                    component = accuracy * self.total[axis * self.order.padded_count + slot]
                    squared += component * component
                weakest = ti.min(weakest, squared)
                if squared < 16.0 * variance:  # beyond, P is below 1e-6
                    probability += rough_exponential(-squared / variance)
            limit, least = self.estimate.limit[group], self.estimate.least[group]
            pending = probability > SHARE * ti.cast(end - begin, float) and limit > least
            self.estimate.pending[group] = ti.cast(pending, ti.i32)
            if pending:
                ratio = ti.min(ti.sqrt(weakest / variance) / MARGIN, 1.0)
                self.estimate.limit[group] = ti.max(limit * rough_power(ratio, EXPONENT), least)
                parts += ti.cast(probability * PARTS + 0.5, ti.i32)
        return parts
