"""Numbers of a kernel that have the operators of a number, and vectors of them.

A formula that only adds, subtracts, multiplies and divides is one text for the plain numbers of Taichi and for these numbers:
double-single numbers of two parts (double_single.py), dual numbers with a derivative (dual.py), and the numbers of several
copies of a system (lanes.py). Taichi applies the operators of Python, which are the operators of the classes below. For roots,
choices and constants a formula calls force_numbers.py.

A result is a new local variable of the kernel. `x = y` gives a second name to a number and does not copy it, so a formula must
not assign to x or y afterwards; results of operators, `zeros` and `copied` may be assigned to.
"""

from abc import ABC, abstractmethod
from typing import Any

from mpp_taichi.arithmetic.traced import traced


class KernelNumber(ABC):
    """A number in a kernel; the kinds of numbers say how two of them are added, multiplied and divided."""

    _data_oriented = True  # Taichi passes such objects on as they are
    written_out = False
    """Whether a sum over few pairs is written out; it takes longer to compile the more variables a number has."""

    @abstractmethod
    def lifted(self, other: Any) -> Any:
        """Another number as one of this kind; of itself where it is one already."""

    @abstractmethod
    def plus(self, other: Any) -> Any:
        """Self + other, which are of one kind, as in the methods below."""

    @abstractmethod
    def minus(self, other: Any) -> Any:
        """Self − other."""

    @abstractmethod
    def times(self, other: Any) -> Any:
        """Self × other."""

    @abstractmethod
    def over(self, other: Any) -> Any:
        """Self / other."""

    @abstractmethod
    def accumulated(self, other: Any) -> Any:
        """Self + other in a sum of several terms."""

    @abstractmethod
    def where(self, condition: Any, other: Any) -> Any:
        """Self where a condition holds, else other."""

    @abstractmethod
    def root(self) -> Any:
        """√self."""

    @abstractmethod
    def inverse_root(self) -> Any:
        """1/√self."""

    @property
    @abstractmethod
    def main(self) -> Any:
        """The part that tells the sign."""

    @abstractmethod
    def __neg__(self) -> Any:
        """−self."""

    @abstractmethod
    def copied(self) -> Any:
        """The number in new variables."""

    @abstractmethod
    def _assign(self, other: Any) -> None:
        """Assign; Taichi calls the method by this name."""

    def _augassign(self, other: Any, operator: str) -> None:
        self._assign(AUGMENTED[operator](self, self.lifted(other)))

    def __add__(self, other: Any) -> Any:
        """Self + other; adding the constant 0, as a softening of 0, takes no work."""
        return self if isinstance(other, (int, float)) and other == 0 else self.plus(self.lifted(other))

    def __sub__(self, other: Any) -> Any:
        """Self − other."""
        return self.minus(self.lifted(other))

    def __mul__(self, other: Any) -> Any:
        """Self × other, where other is a number or a vector."""
        return NotImplemented if isinstance(other, NumberVector) else self.times(self.lifted(other))

    def __truediv__(self, other: Any) -> Any:
        """Self / other."""
        return self.over(self.lifted(other))

    def __radd__(self, other: Any) -> Any:
        """Other + self."""
        return self.lifted(other) + self

    def __rsub__(self, other: Any) -> Any:
        """Other − self."""
        return self.lifted(other) - self

    def __rmul__(self, other: Any) -> Any:
        """Other × self."""
        return self.lifted(other) * self

    def __rtruediv__(self, other: Any) -> Any:
        """Other / self."""
        return self.lifted(other) / self

    def __gt__(self, other: float) -> Any:
        """Self > other, where other is 0."""
        return self._beside_zero(other) > 0.0

    def __ne__(self, other: object) -> Any:
        """Self ≠ other, where other is 0."""
        return self._beside_zero(other) != 0.0

    def _beside_zero(self, other: object) -> Any:
        if other != 0.0:
            raise TypeError(f"a {type(self).__name__} is compared with 0 only")
        return self.main


AUGMENTED = {"Add": lambda a, b: a.accumulated(b), "Sub": lambda a, b: a.accumulated(-b), "Mult": lambda a, b: a * b}
"""The operators of += and its like, by Taichi's names."""


class NumberVector:
    """A vector of such numbers in a kernel."""

    _data_oriented = True

    def __init__(self, components: Any) -> None:
        """Name the components."""
        self.components = tuple(components)
        self.n = len(self.components)

    def __getitem__(self, k: int) -> Any:
        """One component."""
        return self.components[k]

    def __add__(self, other: Any) -> Any:
        """Self + other, both vectors."""
        return NumberVector(a + b for a, b in zip(self.components, other.components, strict=True))

    def __sub__(self, other: Any) -> Any:
        """Self − other, both vectors."""
        return NumberVector(a - b for a, b in zip(self.components, other.components, strict=True))

    def __mul__(self, factor: Any) -> Any:
        """Self × number."""
        return NumberVector(each * factor for each in self.components)

    def __rmul__(self, factor: Any) -> Any:
        """Number × self."""
        return self * factor

    def __neg__(self) -> Any:
        """−self."""
        return NumberVector(-each for each in self.components)

    @traced
    def dot(self, other: Any) -> Any:
        """Inner product."""
        total = self[0] * other[0]
        for k in range(1, self.n):
            total = total.accumulated(self[k] * other[k])
        return total

    def copied(self) -> Any:
        """The vector in new variables."""
        return NumberVector(each.copied() for each in self.components)

    def _assign(self, other: Any) -> None:
        for k in range(self.n):
            self[k]._assign(other[k])

    def _augassign(self, other: Any, operator: str) -> None:
        for k in range(self.n):
            self[k]._augassign(other[k], operator)
