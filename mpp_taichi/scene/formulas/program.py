"""Programs: several formulas as one list of steps, each computed once, for NumPy and for kernels alike.

A step has an operation and the numbers of earlier steps. Equal steps are one step, powers to whole numbers share their squares,
and quotients are collected, so that a formula costs what a careful hand would write.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from mpp_taichi.arithmetic.point_function import POINTS, PointFunction
from mpp_taichi.scene.formulas.array_steps import ArrayArithmetic

Law = TypeVar("Law")
PLAIN_STEPS = ("number", "name", "+", "-", "*", "/", "root", "chosen", "abs", POINTS)
"""Steps that every device has in every precision."""


class StepProgram:
    """The steps that compute some expressions; `names` are the symbols that it needs values for."""

    def __init__(self, steps: Sequence[tuple[Any, ...]], results: Sequence[int]) -> None:
        """Take steps, of which each uses earlier ones, and the steps whose values are the results."""
        self.steps, self.results = list(steps), list(results)
        self.names = frozenset(step[1] for step in self.steps if step[0] == "name")
        self.functions = tuple(dict.fromkeys(step[0] for step in self.steps if step[0] not in PLAIN_STEPS))
        """The functions beyond arithmetic and roots that the steps call."""
        used = Counter(argument for step in self.steps for argument in _arguments(step))
        used.update(self.results)
        self.points = tuple(dict.fromkeys(step[2] for step in self.steps if step[0] == POINTS))
        """The functions through points that the steps call."""
        self._shared = {place for place, count in used.items() if count > 1}

    @classmethod
    def of(
        cls, expressions: Sequence[Any], variables: Collection[str], inverted: Collection[str] = (), within: Any = None
    ) -> "StepProgram":
        """The program of SymPy expressions; all names but the `variables` are numbers, which are multiplied first.

        Of the `inverted` names the inverse is computed once. Where an expression `within` is given and not above 0, results are
        0.
        """
        from mpp_taichi.scene.formulas.lowering import Lowering  # with SymPy

        made = Lowering(variables, inverted)
        results = [made.lower(each) for each in expressions]
        if within is not None:
            inside = made.lower(within)
            results = [made.step("chosen", inside, each, made.step("number", 0.0)) for each in results]
        return cls(made.steps, results)

    def with_numbers(self, values: Mapping[str, float]) -> "StepProgram":
        """The program with numbers for some names, and with the steps computed that only need numbers."""
        return _folded(self, values)

    @property
    def takes_lanes(self) -> bool:
        """Whether vectors of lanes may be the values of the steps.

        These only add, subtract, multiply and divide, but for a cutoff at the end, which sets numbers to 0.
        """
        steps = self.steps[:-1] if self.steps and self.steps[-1][0] == "chosen" else self.steps
        return all(step[0] in ("number", "name", "+", "-", "*", "/") for step in steps)

    def run(self, arithmetic: Any, values: Mapping[str, Any], like: Any) -> list[Any]:
        """The results, with values for the names; `like` is a value whose kind the numbers of the program take."""
        found: list[Any] = []
        for place, step in enumerate(self.steps):
            value = self._one(arithmetic, values, like, found, step)
            found.append(arithmetic.kept(value) if place in self._shared and step[0] not in ("number", "name") else value)
        return [found[place] for place in self.results]

    def _one(self, arithmetic: Any, values: Mapping[str, Any], like: Any, found: list[Any], step: tuple[Any, ...]) -> Any:
        operation, *arguments = step
        if operation == "number":
            return arithmetic.number(arguments[0], like)
        if operation == "name":
            return values[arguments[0]]
        if operation == "power":
            return arithmetic.power(found[arguments[0]], arguments[1])
        if operation == POINTS:
            return arithmetic.through_points(found[arguments[0]], *arguments[1:])
        numbers = [found[each] for each in arguments]
        if operation == "+":
            return numbers[0] + numbers[1]
        if operation == "-":
            return numbers[0] - numbers[1]
        if operation == "*":
            return numbers[0] * numbers[1]
        if operation == "/":
            return numbers[0] / numbers[1]
        if operation == "root":
            return arithmetic.root(numbers[0])
        if operation == "chosen":
            return arithmetic.chosen(*numbers)
        return arithmetic.function(operation, numbers[0])


def with_numbers(law: Law, fixed: Sequence[tuple[str, float]], live: tuple[str, ...]) -> Law:
    """A law, which is a dataclass with programs, with numbers for the `fixed` names of all its programs."""
    of_law: Any = law
    programs = {each.name: getattr(law, each.name) for each in fields(of_law)}
    numbers = dict(fixed)
    changed = {name: each.with_numbers(numbers) for name, each in programs.items() if isinstance(each, StepProgram)}
    functions = tuple(dict.fromkeys(function for each in changed.values() for function in each.functions))
    low = not functions and not points_of(replace(of_law, **changed)) and not of_law.flags.get("depends_on_time", False)
    flags = {**of_law.flags, "has_functions": functions, "takes_low_parts": low}
    found: Law = replace(of_law, **changed, flags=flags, live=live)
    return found


def points_of(law: Any) -> tuple[PointFunction, ...]:
    """The functions through points that the programs of a law, a dataclass, call."""
    programs = (getattr(law, each.name) for each in fields(law))
    found = [function for each in programs if isinstance(each, StepProgram) for function in each.points]
    return tuple(dict.fromkeys(found))


def _arguments(step: tuple[Any, ...]) -> tuple[int, ...]:
    """The earlier steps that a step uses."""
    if step[0] in ("number", "name"):
        return ()
    return step[1:2] if step[0] in ("power", POINTS) else step[1:]


_IDENTITIES = {"+": 0.0, "*": 1.0}
"""Numbers that change nothing as either operand of an operator."""
_RIGHT_IDENTITIES = {"-": 0.0, "/": 1.0, **_IDENTITIES}


def _folded(program: StepProgram, values: Mapping[str, float]) -> StepProgram:
    """See StepProgram.with_numbers."""
    steps: list[tuple[Any, ...]] = []
    known: dict[tuple[Any, ...], int] = {}
    places: list[int] = []  # of the steps of `program`

    def put(step: tuple[Any, ...]) -> int:
        if step not in known:
            known[step] = len(steps)
            steps.append(step)
        return known[step]

    def number_at(place: int) -> float | None:
        return steps[place][1] if steps[place][0] == "number" else None

    for step in program.steps:
        if step[0] == "name" and step[1] in values:
            places.append(put(("number", float(values[step[1]]))))
            continue
        if step[0] in ("number", "name"):
            places.append(put(step))
            continue
        arguments = [places[each] for each in _arguments(step)]
        numbers = [number_at(each) for each in arguments]
        if None not in numbers:
            with np.errstate(all="ignore"):
                alone = StepProgram(
                    [*(("number", each) for each in numbers), _moved(step, range(len(numbers)))], [len(numbers)]
                )
                places.append(put(("number", float(alone.run(ArrayArithmetic, {}, 0.0)[0]))))
        elif step[0] in _RIGHT_IDENTITIES and numbers[1] == _RIGHT_IDENTITIES[step[0]]:
            places.append(arguments[0])
        elif step[0] in _IDENTITIES and numbers[0] == _IDENTITIES[step[0]]:
            places.append(arguments[1])
        else:
            places.append(put(_moved(step, arguments)))
    return _without_unused(steps, [places[each] for each in program.results])


def _moved(step: tuple[Any, ...], arguments: Sequence[int]) -> tuple[Any, ...]:
    """A step that uses other steps."""
    return (step[0], *arguments, *step[1 + len(_arguments(step)) :])


def _without_unused(steps: Sequence[tuple[Any, ...]], results: Sequence[int]) -> StepProgram:
    """The program of the steps that lead to the results."""
    wanted = set(results)
    for place in range(len(steps) - 1, -1, -1):
        if place in wanted:
            wanted.update(_arguments(steps[place]))
    places = {old: new for new, old in enumerate(sorted(wanted))}
    kept = [_moved(steps[old], [places[each] for each in _arguments(steps[old])]) for old in sorted(wanted)]
    return StepProgram(kept, [places[each] for each in results])
