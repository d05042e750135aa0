"""The law of a path: the place x(t) of a body as a formula of the time, with the velocity x′(t) and the acceleration x″(t).

The derivatives are SymPy's. Where a formula has a kink, x″ leaves the jump of the velocity out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from mpp_taichi.scene.expressions import ExpressionError
from mpp_taichi.scene.formulas.array_steps import ArrayArithmetic
from mpp_taichi.scene.formulas.external_law import LawError
from mpp_taichi.scene.formulas.grammar import checked_size, meaning, symbolic, tidy
from mpp_taichi.scene.formulas.meanings import Meanings, parsed
from mpp_taichi.scene.formulas.program import StepProgram
from mpp_taichi.scene.formulas.time_limit import in_time

TIME = "t"


@dataclass(frozen=True, eq=False)
class PathLaw:
    """The programs of a path, of the time t alone.

    motion   one result for each axis of x(t), then one for each axis of x′(t)
    change   one result for each axis of x′(t), then one for each axis of x″(t)
    """

    dimensions: int
    motion: StepProgram
    change: StepProgram

    @property
    def functions(self) -> tuple[str, ...]:
        """The functions beyond arithmetic and roots that the path calls, such as sin."""
        return tuple(dict.fromkeys((*self.motion.functions, *self.change.functions)))

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """x [length] and x′ [length / time] at a time, each (3,); an axis beyond the dimensions has 0."""
        found = self._numbers(self.motion, np.array([time]))
        result = np.zeros((2, 3))
        result[:, : self.dimensions] = found.reshape(2, self.dimensions)
        return result[0], result[1]

    def acceleration_at(self, time: float) -> np.ndarray:
        """x″ [length / time²] at a time, (3,)."""
        result = np.zeros(3)
        result[: self.dimensions] = self._numbers(self.change, np.array([time]))[self.dimensions :, 0]
        return result

    def rows_at(self, times: np.ndarray) -> np.ndarray:
        """The components of x at some times, then those of x′ and those of x″, (3 axes, times)."""
        return np.concatenate([self._numbers(self.motion, times), self._numbers(self.change, times)[self.dimensions :]])

    def first_bad(self, times: np.ndarray) -> tuple[int, str, float] | None:
        """(axis, "x", "x′" or "x″", time) of the first of these times at which a number is not finite; None: all are."""
        bad = ~np.isfinite(self.rows_at(times))
        if not bad.any():
            return None
        column = int(np.argmax(bad.any(axis=0)))
        row = int(np.argmax(bad[:, column]))
        return row % self.dimensions, ("x", "x′", "x″")[row // self.dimensions], float(times[column])

    @staticmethod
    def _numbers(program: StepProgram, times: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            found = program.run(ArrayArithmetic, {TIME: times}, times)
        return np.array([np.broadcast_to(np.asarray(each, float), times.shape) for each in found])


def path_law(texts: Sequence[Any]) -> PathLaw:
    """The law of a path from its formulas, one for each axis, which know the constants of their scene (FormulaText).

    LawError, with the number of the formula and the character, where a text is no such formula.
    """
    return _derived(tuple((str(text), tuple(sorted(text.constants.items()))) for text in texts))


@lru_cache(maxsize=1024)
@in_time
def _derived(texts: tuple[tuple[str, Meanings], ...]) -> PathLaw:
    time = sympy.Symbol(TIME, real=True)
    places, velocities, pushes = [], [], []
    for which, (text, constants) in enumerate(texts):
        try:
            values: Mapping[str, Any] = {TIME: time} | {name: meaning(value) for name, value in constants}
            if any(name == TIME for name, _ in constants):
                raise ExpressionError("t is the time here and a constant of the scene, rename the constant")
            expression = parsed(text, constants)
            expression.check_names(values)
            place = symbolic(expression, values)
            velocity = checked_size(sympy.diff(place, time))
            places.append(place)
            velocities.append(tidy(velocity))
            pushes.append(tidy(checked_size(sympy.diff(velocity, time))))
        except ExpressionError as error:
            raise LawError(which, ExpressionError(_of_paths(str(error)), error.offset)) from None
    programs = [StepProgram.of(each, (TIME,)) for each in ([*places, *velocities], [*velocities, *pushes])]
    return PathLaw(len(texts), programs[0], programs[1])


def _of_paths(message: str) -> str:
    """A message about the formula of a force, told of a path."""
    return message.replace("which a force needs", "which a path needs").replace("the formula of a force", "a path")
