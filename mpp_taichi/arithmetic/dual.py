"""Dual numbers in kernels: a number together with its change along a tangent, x + δx with δx² = 0.

A text that is computed with dual numbers computes its own derivative along the tangent, exactly to round-off:

    (a + δa) ± (b + δb) = a ± b + (δa ± δb)        √(a + δa)   = √a + δa/(2√a)
    (a + δa)(b + δb)    = a b + (δa b + a δb)      1/√(a + δa) = u − ½ u³ δa,  u = 1/√a
    (a + δa)/(b + δb)   = q + (δa − q δb)/b,  q = a/b

The parts without δ are computed as for plain numbers, so that they have the same bits. A constant has no change, and costs none
of the work. Source: Clifford, Proc. London Math. Soc. 4 (1873) 381; Griewank & Walther, Evaluating Derivatives (2008), §3.1.
"""

from abc import ABC, abstractmethod
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_root
from mpp_taichi.arithmetic.kernel_number import KernelNumber
from mpp_taichi.arithmetic.lanes import Lanes


class DualNumber(KernelNumber, ABC):
    """A number and its change in a kernel; without a change it is a constant. Subclasses say of what kind both are."""

    def __init__(self, value: Any, change: Any = None) -> None:
        """Name one or two expressions; a number that is to be assigned to has two variables or entries of fields."""
        self.value, self.change = self.part(value), change

    @staticmethod
    @abstractmethod
    def part(number: Any) -> Any:
        """A plain number as the value of a dual number."""

    @staticmethod
    @abstractmethod
    def nothing() -> Any:
        """The value 0, which is also the change of a constant."""

    @classmethod
    def zero(cls) -> "DualNumber":
        """Zero in new variables, to be added to."""
        return cls(_variable(cls.nothing()), _variable(cls.nothing()))

    def lifted(self, other: Any) -> Any:
        """A plain number as a constant."""
        return other if isinstance(other, DualNumber) else type(self)(other)

    def plus(self, other: Any) -> Any:
        """The sum, and the sum of the changes."""
        return self._kept(self.value + other.value, _sum(self.change, other.change))

    def minus(self, other: Any) -> Any:
        """The difference, and the difference of the changes."""
        change = self.change if other.change is None else _sum(self.change, -other.change)
        return self._kept(self.value - other.value, change)

    def times(self, other: Any) -> Any:
        """The product, with the change δa b + a δb."""
        mine = None if self.change is None else self.change * other.value
        return self._kept(self.value * other.value, _sum(mine, None if other.change is None else self.value * other.change))

    def over(self, other: Any) -> Any:
        """The quotient q, with the change (δa − q δb)/b."""
        quotient, change = _variable(self.value / other.value), self.change
        if other.change is not None:
            change = _sum(change, -(quotient * other.change))
        return self._kept(quotient, None if change is None else change / other.value)

    def accumulated(self, other: Any) -> Any:
        """The sum."""
        return self.plus(other)

    def where(self, condition: Any, other: Any) -> Any:
        """Self where a condition holds, else other."""
        other = self.lifted(other)
        changes = [self.nothing() if each.change is None else each.change for each in (self, other)]
        return self._kept(_chosen(condition, self.value, other.value), _chosen(condition, *changes))

    def root(self) -> Any:
        """√a, with the change δa/(2√a)."""
        root = _variable(self.value.root() if isinstance(self.value, KernelNumber) else ti.sqrt(self.value))
        return self._kept(root, None if self.change is None else 0.5 * self.change / root)

    def inverse_root(self) -> Any:
        """U = 1/√a, with the change −½ u³ δa."""
        inverse = _variable(inverse_root(self.value))
        return self._kept(inverse, None if self.change is None else -0.5 * self.change * (inverse * inverse * inverse))

    @property
    def main(self) -> Any:
        """The value."""
        return self.value

    def copied(self) -> Any:
        """The number in new variables, which may be assigned to."""
        return self._kept(self.value, self.nothing() if self.change is None else self.change)

    def __neg__(self) -> Any:
        """−self."""
        return self._kept(-self.value, None if self.change is None else -self.change)

    def _assign(self, other: Any) -> None:
        other = self.lifted(other)
        self.value._assign(other.value)
        self.change._assign(0.0 if other.change is None else other.change)

    def _kept(self, value: Any, change: Any) -> "DualNumber":
        """A number of the same kind in new variables of the kernel."""
        return type(self)(_variable(value), None if change is None else _variable(change))


class Dual(DualNumber):
    """A dual number whose parts are plain numbers."""

    @staticmethod
    def part(number: Any) -> Any:
        """The number itself."""
        return number

    @staticmethod
    def nothing() -> Any:
        """Zero."""
        return ti.cast(0.0, float)


class DualLanes(DualNumber):
    """A dual number of each of several copies of a system, whose parts are lanes (lanes.py)."""

    written_out = True

    @staticmethod
    def part(number: Any) -> Any:
        """A plain number for all copies."""
        return number if isinstance(number, Lanes) else Lanes(number)

    @staticmethod
    def nothing() -> Any:
        """Zero in each lane."""
        return Lanes.zero()


def _sum(a: Any, b: Any) -> Any:
    """The sum of two changes, of which either may be absent."""
    if a is None or b is None:
        return b if a is None else a
    return a + b


def _chosen(condition: Any, a: Any, b: Any) -> Any:
    return a.where(condition, b) if isinstance(a, KernelNumber) else ti.select(condition, a, b)


def _variable(number: Any) -> Any:
    """A number in a new variable of the kernel, as results of lanes are already."""
    return number.copied() if isinstance(number, KernelNumber) else ti.lang.impl.expr_init(number)
