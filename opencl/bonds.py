"""Formulas along springs: the text of their steps for the kernels of springs, and which springs have which of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.scene.groups import is_in

from .formula import macro, steps_of


@dataclass(frozen=True, eq=False)
class Bond:
    """F = V′(l) d/l along the springs of which both ends are in a group.

    lines     the statements that compute V′(l)/l of the length l and the rest length
    result    the name of the result
    inside    which springs have the force, (spring_count,); None for all
    """

    lines: tuple[str, ...]
    result: str
    inside: np.ndarray | None

    @staticmethod
    def of(law: Any, group: Any, between: np.ndarray, precision: str) -> "Bond":
        """The bond of a law of numbers between these particles.

        ValueError where a number of the formula is beyond the precision.
        """
        lines, result = steps_of(law.shape, precision)
        return Bond(tuple(lines), result, None if group is None else is_in(group, between).all(axis=1))


def bonds_text(bonds: Sequence[Bond]) -> str:
    """BOND_STEPS(T, HAS): the sum of V′(l)/l over the bonds of a spring; HAS(n) says whether it has the bond n.

    Nothing where there are no bonds.
    """
    if not bonds:
        return ""
    lines = ["T total = (T)(0);"]
    for number, bond in enumerate(bonds):
        added = bond.result if bond.inside is None else f"HAS({number}) ? {bond.result} : (T)(0)"
        lines += ["{", *bond.lines, f"total += {added};", "}"]
    return macro("BOND_STEPS(T, HAS)", [*lines, "return total;"])
