"""What is the same for every number that is read off the last look at a run."""

from abc import abstractmethod

from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.snapshot import Snapshot


class AtEnd(Diagnostic):
    """A diagnostic that is a function of the particles at the end of the run."""

    _value: float | None = None

    @abstractmethod
    def measure(self, snapshot: Snapshot) -> float:
        """The number, of the particles as they are.

        Raises:
            NoResultError: they have none.
        """

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Keep the last look."""
        self._value = self.measure(snapshot)

    def result(self) -> float:
        """The number at the last look."""
        if self._value is None:
            raise NoResultError("the run was never looked at")
        return self._value


def rows(of: tuple[int, int] | None) -> slice:
    """The rows of a group, first and length, in the arrays of a snapshot; of all particles where there is none."""
    return slice(None) if of is None else slice(of[0], of[0] + of[1])
