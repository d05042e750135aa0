"""The dihedral angle of four particles in a row."""

import math

import numpy as np

from mpp_taichi.component import FourInRow, component, param
from mpp_taichi.quantities._base import ManySample, NoResultError, Quantity, RunSample, Setting
from mpp_taichi.quantities._particles import center_of


@component
class DihedralAngle(Quantity):
    """Dihedral angle in −π…π of four particles, or of the centres of mass of four groups, about the middle link [radians].

    It is 0 where the outer particles are on the same side of the middle link, and grows where the last of them turns about this
    link by the right-hand rule. It has no value where three of them in a row are on a line.
    """

    takes_many = True

    of: FourInRow = param(help="four particles or groups of one size in their order, or a chain of four particles")
    zero: float = param(0.0, unit="radians", help="angle subtracted before the result is brought into −π…π")

    def begin(self, setting: Setting) -> None:
        """Refuse groups that share particles.

        Raises:
            NoResultError: they do, as the four in a row of a longer chain.
        """
        ends = sorted((first, first + count) for first, count in self.of)
        if any(end > start for (_, end), (start, _) in zip(ends[:-1], ends[1:], strict=True)):
            raise NoResultError("the four groups share particles, must be four particles or groups apart")

    def label(self, setting: Setting) -> str:
        """`dihedral of a, b, c, d`."""
        return f"dihedral of {', '.join(setting.name_of(each) for each in self.of)}"

    def measure(self, sample: RunSample) -> float:
        """The angle.

        Raises:
            NoResultError: three of the particles are on a line.
        """
        place = sample.snapshot.position
        (found,) = self._angles([center_of(place, sample.snapshot, each)[None] for each in self.of])
        if math.isnan(found):
            raise NoResultError("three of the particles are on a line, about which there is no dihedral angle")
        return found

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The angle in each copy, by the same functions."""
        place = many.snapshot.position
        return np.array(self._angles([center_of(place, many.snapshot, each) for each in self.of]))

    def _angles(self, places: list[np.ndarray]) -> list[float]:
        """Of the places of the four, (n, 3) each; NaN where there is no angle."""
        before, middle, after = (end - start for start, end in zip(places[:-1], places[1:], strict=True))
        a, b = np.cross(before, middle), np.cross(middle, after)
        sine, cosine = np.sqrt(_dot(middle, middle)) * _dot(before, b), _dot(a, b)
        there = np.logical_and(a.any(axis=1), b.any(axis=1))
        return [
            math.remainder(math.atan2(s, c) - self.zero, math.tau) if known else math.nan
            for s, c, known in zip(sine.tolist(), cosine.tolist(), there.tolist(), strict=True)
        ]


def _dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Scalar products of vectors, (n, 3) → (n,), by operations whose bits do not depend on n."""
    return np.asarray(one[:, 0] * other[:, 0] + one[:, 1] * other[:, 1] + one[:, 2] * other[:, 2])
