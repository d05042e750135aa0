"""Mutants by the operators of cosmic-ray: other operators and comparisons, other truth values, numbers, loops.

The library's runner is not used: its operators say where they apply, and change the syntax tree of parso, which keeps every
character. Left out are operators whose mutants fail at once in any test (a shift of a float), or which change a decorator.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from mutation.source import Mutant, Source

OPERATORS = (
    "ReplaceBinaryOperator_Add_Sub",
    "ReplaceBinaryOperator_Sub_Add",
    "ReplaceBinaryOperator_Mul_Div",
    "ReplaceBinaryOperator_Div_Mul",
    "ReplaceBinaryOperator_FloorDiv_Mul",
    "ReplaceBinaryOperator_Mod_FloorDiv",
    "ReplaceBinaryOperator_Pow_Mul",
    "ReplaceBinaryOperator_BitOr_BitAnd",
    "ReplaceBinaryOperator_BitAnd_BitOr",
    "ReplaceComparisonOperator_Eq_NotEq",
    "ReplaceComparisonOperator_NotEq_Eq",
    "ReplaceComparisonOperator_Lt_LtE",
    "ReplaceComparisonOperator_LtE_Lt",
    "ReplaceComparisonOperator_Gt_GtE",
    "ReplaceComparisonOperator_GtE_Gt",
    "ReplaceComparisonOperator_Lt_Gt",
    "ReplaceComparisonOperator_Gt_Lt",
    "ReplaceComparisonOperator_Is_IsNot",
    "ReplaceComparisonOperator_IsNot_Is",
    "ReplaceUnaryOperator_Delete_Not",
    "ReplaceUnaryOperator_Delete_USub",
    "ReplaceAndWithOr",
    "ReplaceOrWithAnd",
    "ReplaceTrueWithFalse",
    "ReplaceFalseWithTrue",
    "ReplaceBreakWithContinue",
    "ReplaceContinueWithBreak",
    "AddNot",
    "NumberReplacer",
    "ZeroIterationForLoop",
)


@dataclass(frozen=True)
class Place:
    """Where an operator of the library applies: the mutant is made when it is drawn, since that parses the module anew."""

    line: int
    operator: str
    change: Any
    span: tuple
    occurrence: int

    def mutant(self, source: Source) -> Mutant | None:
        """The smallest change of characters that the operator makes here; None where it makes none."""
        mutated = self._mutated(source.text)
        if mutated is None or mutated == source.text:
            return None
        text, shorter = source.text, min(len(source.text), len(mutated))
        start = next((k for k in range(shorter) if text[k] != mutated[k]), shorter)
        same = next((k for k in range(shorter - start) if text[-1 - k] != mutated[-1 - k]), shorter - start)
        kept = mutated[start : len(mutated) - same]
        return Mutant(source.path, source.line_of(start), self.operator, start, len(text) - same, kept)

    def _mutated(self, text: str) -> str | None:
        from cosmic_ray.ast import Visitor, get_ast

        place = self

        class Once(Visitor):
            def visit(self, node):
                places = list(place.change.mutation_positions(node))
                if len(places) > place.occurrence and places[place.occurrence] == place.span:
                    return place.change.mutate(node, place.occurrence)
                return node

        tree = Once().walk(get_ast(text))
        return tree.get_code() if tree is not None else None


def cosmic_ray_places(source: Source) -> Iterator[Place]:
    """Every place of the module where one of these operators applies.

    Raises:
        ModuleNotFoundError: cosmic-ray is not installed.
    """
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.operators.provider import OperatorProvider

    known = OperatorProvider()
    operators = [(name, known[name]()) for name in OPERATORS]
    for node in ast_nodes(get_ast(source.text)):
        for name, operator in operators:
            for occurrence, (first, last) in enumerate(operator.mutation_positions(node)):
                start, end = (source.offset(*place, in_bytes=False) for place in (first, last))
                if source.is_open(start, end, formatted=True):
                    yield Place(first[0], name, operator, (first, last), occurrence)
