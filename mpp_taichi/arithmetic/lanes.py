"""Lanes in kernels: the same number of several copies of a system, one in each lane of a vector register of the CPU.

A text that is computed with lanes computes as many copies at once, each with the bits that it has by itself: every operation is
that of plain numbers, rounded in the same way in each lane. The kernel must be compiled with explicit vectors, which have no
comparisons and no choices; here both are taken lane by lane. A number that is the same in all copies stays a plain number.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_root
from mpp_taichi.arithmetic.kernel_number import KernelNumber

LANES = 8
"""Numbers of a vector: a register of AVX-512 in f64; twice as many in f32 take four times as long to compile."""


class LaneCondition:
    """A condition of each lane."""

    _data_oriented = True

    def __init__(self, by_lane: Any) -> None:
        """Name the conditions."""
        self.by_lane = list(by_lane)


class Lanes(KernelNumber):
    """A number of each copy; or one number for all copies, as parameters of the scene are."""

    written_out = True

    def __init__(self, value: Any, entries: Any = None) -> None:
        """Name a vector, or a plain number; `entries` are the entries of fields from which the vector was read."""
        self.value, self.entries = value.value if isinstance(value, Lanes) else value, entries

    @staticmethod
    def zero() -> "Lanes":
        """Zero in each lane of a new variable, to be added to."""
        return _kept(vector([0.0] * LANES))

    def lifted(self, other: Any) -> Any:
        """A plain number for all copies."""
        return other if isinstance(other, Lanes) else Lanes(other)

    def plus(self, other: Any) -> Any:
        """The sum."""
        return _kept(self.value + other.value)

    def minus(self, other: Any) -> Any:
        """The difference."""
        return _kept(self.value - other.value)

    def times(self, other: Any) -> Any:
        """The product."""
        return _kept(self.value * other.value)

    def over(self, other: Any) -> Any:
        """The quotient."""
        return _kept(self.value / other.value)

    def accumulated(self, other: Any) -> Any:
        """The sum."""
        return self.plus(other)

    def where(self, condition: Any, other: Any) -> Any:
        """Self where a condition holds, else other; the condition of each lane, or one for all."""
        mine, others = self.by_lane(), self.lifted(other).by_lane()
        each = condition.by_lane if isinstance(condition, LaneCondition) else [condition] * len(mine)
        return _kept(vector([ti.select(*choice) for choice in zip(each, mine, others, strict=True)]))

    def root(self) -> Any:
        """√a."""
        return _kept(ti.sqrt(self.value))

    def inverse_root(self) -> Any:
        """1/√a."""
        return _kept(inverse_root(self.value))

    @property
    def main(self) -> Any:
        """The number itself."""
        return self.value

    def __neg__(self) -> Any:
        """−self, as a product, for explicit vectors have no minus of a vector."""
        return _kept(-1.0 * self.value)

    def __gt__(self, other: float) -> Any:
        """Whether each lane is above 0."""
        return LaneCondition(each > 0.0 for each in self.by_lane()) if self.differs else self._beside_zero(other) > 0.0

    def __ne__(self, other: object) -> Any:
        """Whether each lane is not 0."""
        return LaneCondition(each != 0.0 for each in self.by_lane()) if self.differs else self._beside_zero(other) != 0.0

    @property
    def differs(self) -> bool:
        """Whether each copy has a number of its own."""
        return isinstance(self.value, ti.lang.expr.Expr) and self.value.is_tensor()

    def by_lane(self) -> list[Any]:
        """The numbers of the copies as plain numbers."""
        lanes = range(LANES)
        return [ti.lang.impl.subscript(None, self.value, k) for k in lanes] if self.differs else [self.value for _ in lanes]

    def copied(self) -> Any:
        """The numbers in a new variable, which may be assigned to."""
        return _kept(self.value if self.differs else vector(self.by_lane()))

    def _assign(self, other: Any) -> None:
        other = self.lifted(other)
        if self.entries is not None:
            for entry, value in zip(self.entries, other.by_lane(), strict=True):
                entry._assign(value)
        else:
            self.value._assign(other.value if other.differs else vector(other.by_lane()))


def vector(numbers: Any) -> Any:
    """Numbers of the run's precision as one vector."""
    return ti.lang.matrix.make_matrix(list(numbers), float)


def _kept(value: Any) -> Lanes:
    """A new variable of the kernel."""
    return Lanes(ti.lang.impl.expr_init(value))
