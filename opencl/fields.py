"""Formulas of fields: the text of their steps for the kernels of motion, and which particles feel which of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.scene.groups import is_in

from .formula import macro, results_of

NAMES = ("x", "y", "z", "m", "q", "R")
"""What a formula of a place may read here: the place, and the mass, the charge and the radius of the particle."""


@dataclass(frozen=True, eq=False)
class Field:
    """a = f(x, y, z, m, q, R) of the particles of a group.

    lines     the statements that compute the acceleration
    results   the names of its components
    inside    which particles feel it, (particle_count,); None for all
    """

    lines: tuple[str, ...]
    results: tuple[str, ...]
    inside: np.ndarray | None

    @staticmethod
    def of(law: Any, group: Any, count: int, precision: str) -> "Field":
        """The field of a law of numbers that acts on these of `count` particles.

        ValueError where the law depends on more than the place, and where a number is beyond the precision.
        """
        if law.flags["depends_on_velocity"]:
            raise ValueError("it depends on the velocity")
        if law.flags["depends_on_time"]:
            raise ValueError("it depends on the time")
        lines, results = results_of(law.acceleration, precision)
        return Field(tuple(lines), tuple(results), None if group is None else is_in(group, np.arange(count)))


def fields_text(fields: Sequence[Field]) -> str:
    """FIELD_STEPS(T, HAS): the sum of the accelerations by the fields; HAS(n) says whether a particle feels field n.

    Nothing where there are no fields.
    """
    if not fields:
        return ""
    lines = ["REAL4 total = (REAL4)(0);"]
    for number, field in enumerate(fields):
        felt = "" if field.inside is None else f"if (HAS({number})) "
        added = [f"total.{axis} += {result};" for axis, result in zip("xyz", field.results)]
        lines += [f"{felt}{{", *field.lines, *added, "}"]
    return macro("FIELD_STEPS(T, HAS)", [*lines, "return total;"])
