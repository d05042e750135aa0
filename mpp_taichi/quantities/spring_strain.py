"""Strain of a spring."""

import numpy as np

from mpp_taichi.component import Pair, component, param
from mpp_taichi.quantities._base import OfEach, RunSample, Setting
from mpp_taichi.quantities._springs import chosen_springs, label_of, lengths, whole_springs


@component
class SpringStrain(OfEach):
    """Strain of a spring (l − L) / L, L its length at rest; of all springs their mean; a histogram shows all strains.

    The rest length of a spring that yields is the present rest length: the strain is the elastic strain. Broken springs have
    none.
    """

    between: Pair = param(None, optional=True, help="the particles at its ends; absent: all springs")

    def begin(self, setting: Setting) -> None:
        """Find the springs; beside springs with a rest length those without, as hinges have, are left out."""
        found = chosen_springs(self.between, setting)
        lasting = found[setting.start.springs.rest_length[found] > 0.0]
        self._springs = lasting if len(lasting) else found

    def label(self, setting: Setting) -> str:
        """`strain of spring pivot–upper`."""
        return label_of("strain", self.between, setting)

    def measure(self, sample: RunSample) -> float:
        """The mean strain."""
        return float(self.each(sample).mean())

    def each(self, sample: RunSample) -> np.ndarray:
        """The strains; springs without a length at rest have none."""
        springs = whole_springs(sample, self._springs)
        with np.errstate(divide="ignore", invalid="ignore"):
            return lengths(sample, springs) / sample.snapshot.springs.rest_length[springs] - 1.0
