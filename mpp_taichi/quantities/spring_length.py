"""Length of a spring."""

import numpy as np

from mpp_taichi.component import Pair, component, param
from mpp_taichi.quantities._base import OfEach, RunSample, Setting
from mpp_taichi.quantities._springs import chosen_springs, label_of, lengths, whole_springs


@component
class SpringLength(OfEach):
    """Length of a spring [length]; of all springs their mean; a histogram shows all lengths. Broken springs have none."""

    between: Pair = param(None, optional=True, help="the particles at its ends; absent: all springs")
    dimension = (1, 0, 0)

    def begin(self, setting: Setting) -> None:
        """Find the springs."""
        self._springs = chosen_springs(self.between, setting)

    def label(self, setting: Setting) -> str:
        """`length of spring pivot–upper`."""
        return label_of("length", self.between, setting)

    def measure(self, sample: RunSample) -> float:
        """The mean length."""
        return float(self.each(sample).mean())

    def each(self, sample: RunSample) -> np.ndarray:
        """The lengths."""
        return lengths(sample, whole_springs(sample, self._springs))
