"""Named reduction: a quantity and its reduction under one name of their own, for the keys of `expect:` that have one."""

from abc import abstractmethod
from functools import cached_property

from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.quantities._base import RunSample, Setting


class NamedReduction(Diagnostic):
    """A component that declares parameters, and makes a quantity and its reduction from them."""

    @abstractmethod
    def reduction(self) -> Diagnostic:
        """The reduction of the quantity."""

    @cached_property
    def _reduction(self) -> Diagnostic:
        return self.reduction()

    def begin(self, setting: Setting) -> None:
        """Prepare the quantity."""
        self._reduction.begin(setting)

    def observe(self, sample: RunSample) -> None:
        """Take a sample."""
        self._reduction.observe(sample)

    def finish(self) -> None:
        """Measure the last sample."""
        self._reduction.finish()

    @property
    def interval(self) -> float:
        """The interval of the reduction."""
        return self._reduction.interval

    def result(self) -> float:
        """The number of the reduction."""
        return self._reduction.result()
