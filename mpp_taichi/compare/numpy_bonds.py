"""Numpy bonds: forces along springs whose potential is a formula, in float64, and what rounding may do to them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.compare.numpy_pairs import ROUNDINGS
from mpp_taichi.scene.formulas.bond_law import LENGTH, REST
from mpp_taichi.scene.formulas.rounding_steps import Rounded, RoundingArithmetic
from mpp_taichi.scene.groups import is_in

OF_A_LENGTH = 4.0
"""Roundings of the distance of two stored places: of the differences, their squares, the sum and the root."""


@dataclass(frozen=True, eq=False)
class BondTerm:
    """A formula V(l) along the springs of which both ends are in a group; arrays are (copies, spring_count).

    law      the BondLaw
    live     the numbers of its names
    inside   which springs have the force, (spring_count,)
    """

    law: Any
    live: dict[str, float]
    inside: np.ndarray

    @staticmethod
    def of(law: Any, live: dict[str, float], group: Any, between: np.ndarray) -> "BondTerm":
        """The term of the springs between these particles, of which `group` is None for all."""
        everywhere = np.ones(len(between), bool)
        return BondTerm(law, live, everywhere if group is None else is_in(group, between).all(axis=1))

    def pull(self, length: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """V′(l)/l, the factor of the separation in the force; 0 where the ends coincide."""
        there = self.inside & (length > 0.0)
        return np.where(there, self.law.at("shape", np.where(there, length, 1.0), rest, self.live), 0.0)

    def magnitude(self, length: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """A size of V′(l)/l of which so many roundings as of other terms bound the error of its steps and of the length."""
        there = self.inside & (length > 0.0)
        safe = np.where(there, length, 1.0)
        given = {name: Rounded(np.float64(value), np.abs(value)) for name, value in self.live.items()}
        given |= {LENGTH: Rounded(safe, OF_A_LENGTH * safe), REST: Rounded(rest, np.zeros_like(rest))}
        found = self.law.shape.run(RoundingArithmetic, given, safe)[0]
        return np.where(there, np.abs(found.value) + found.error / ROUNDINGS, 0.0)

    def energy(self, length: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """The sum of V over the springs, (copies,)."""
        return np.sum(np.where(self.inside, self.law.at("energy", length, rest, self.live), 0.0), axis=1)
