"""A field of double-single numbers: two fields of f32, one for the high and one for the low parts."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.double_single import DoubleSingle
from mpp_taichi.arithmetic.kernel_number import NumberVector
from mpp_taichi.arithmetic.low_parts import split
from mpp_taichi.arithmetic.traced import entry_of


class TwoPartField:
    """In a kernel `field[i]` is a double-single number, or a vector of them, that may be assigned to.

    On the host it has the members of a field that copy to and from NumPy, in float64.
    """

    _data_oriented = True  # Taichi passes such objects on as they are

    def __init__(self, state: Any, high: Any, low: Any) -> None:
        """Name the fields of both parts; `state` says whether roundings are guarded."""
        self.state, self.high, self.low = state, high, low

    @property
    def n(self) -> int:
        """Number of components of a vector."""
        return int(self.high.n)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of either field."""
        shape: tuple[int, ...] = self.high.shape
        return shape

    def __getitem__(self, i: Any) -> Any:
        """Entry i in a kernel."""
        high, low = entry_of(self.high, i), entry_of(self.low, i)
        if not isinstance(self.high, ti.MatrixField):
            return DoubleSingle(self.state, high, low)
        return NumberVector(DoubleSingle(self.state, entry_of(high, k), entry_of(low, k)) for k in range(self.n))

    def to_numpy(self) -> np.ndarray:
        """All numbers as float64."""
        return np.asarray(self.high.to_numpy().astype(np.float64) + self.low.to_numpy())

    def from_numpy(self, values: np.ndarray) -> None:
        """Set all numbers."""
        high, low = split(np.asarray(values, np.float64))
        self.high.from_numpy(high)
        self.low.from_numpy(low)
