"""The two ends of a distance in one sample, for the quantity `distance`."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from mpp_taichi.component import Particles
from mpp_taichi.quantities._base import ManySample, RunSample
from mpp_taichi.quantities._particles import center_of


class EndsOfDistance:
    """The separation of the two ends and its rate: value, rate and interval of a sample need the same means over particles.

    Each is computed when it is first asked for, of one system, (3,), or of several copies, (copies, 3).
    """

    def __init__(
        self, sample: RunSample | ManySample, of: Particles | None, to: Particles | None, point: Sequence[float] | None
    ) -> None:
        """`of` is one end; the other end is `point`, or else `to`; None stands for all particles."""
        self.sample, self._of, self._to, self._point = sample, of, to, point

    @cached_property
    def end(self) -> np.ndarray:
        """The place of the other end [length]."""
        snapshot = self.sample.snapshot
        return np.array(self._point) if self._point is not None else center_of(snapshot.position, snapshot, self._to)

    @cached_property
    def separation(self) -> np.ndarray:
        """From the first end to the other [length]."""
        return self.end - center_of(self.sample.snapshot.position, self.sample.snapshot, self._of)

    @cached_property
    def motion(self) -> np.ndarray:
        """The rate of the separation [length / time]."""
        snapshot = self.sample.snapshot
        end = np.zeros(3) if self._point is not None else center_of(snapshot.velocity, snapshot, self._to)
        return end - center_of(snapshot.velocity, snapshot, self._of)
