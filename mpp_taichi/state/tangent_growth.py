"""Tangent growth: the growth of a small deviation, as quantities measure it."""

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class TangentGrowth:
    """The growth L(t) = ln(|δ(t)|/|δ(0)|) of the deviation δ of positions and velocities, of each copy.

    time      time since the start, (copies,)
    growth    L now
    largest   the largest L so far, not below 0
    derivative   of the motion until now with respect to the free positions and velocities at the start, (copies, m, m), a
              column for each of them; None where no quantity needs it
    megno     (1/t) ∫ Y dt with Y(s) = 2 (L(s) − (1/s) ∫ L ds′), which is the mean MEGNO; 0 at the start
    """

    time: np.ndarray
    growth: np.ndarray
    largest: np.ndarray
    megno: np.ndarray
    derivative: np.ndarray | None = None

    def of(self, who: Any) -> "TangentGrowth":
        """The growth of some copies."""
        derivative = None if self.derivative is None else self.derivative[who]
        return TangentGrowth(self.time[who], self.growth[who], self.largest[who], self.megno[who], derivative)
