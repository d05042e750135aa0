"""Diagnostic: a number that a whole run has, found from its samples."""

import math
from abc import ABC, abstractmethod

from mpp_taichi.quantities._base import RunSample, Setting


class Diagnostic(ABC):
    """Follows a run from its start and comes to one number. Changes nothing."""

    def begin(self, setting: Setting) -> None:  # noqa: B027 most have nothing to prepare
        """Prepare for a scene, before the first sample.

        Raises:
            NoResultError: the number is not defined for this scene.
        """

    @abstractmethod
    def observe(self, sample: RunSample) -> None:
        """Take a sample; called at the start, at the end, and in between at least as often as `interval` asks for."""

    def finish(self) -> None:  # noqa: B027 most have their number by then
        """Measure the data that only the last sample has, while the run still stands at its time."""

    @abstractmethod
    def result(self) -> float:
        """The number, finite.

        Raises:
            NoResultError: it is not defined by the samples.
        """

    @property
    def interval(self) -> float:
        """Longest time until the next sample [time]; infinite where the samples of the run's table will do."""
        return math.inf
