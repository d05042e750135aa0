"""Explicit vectors: kernels whose `ti.Vector`s become vector registers of the CPU.

Taichi normally takes every vector apart and leaves it to LLVM to find the vectors again. LLVM 15 does not know the newer
processors and then uses 128 of their 512 bits. Under `explicit_vectors()` a `ti.Vector` of 8 or 16 lanes is one LLVM
vector from end to end, whatever LLVM knows of the machine: three to four times the speed in the pair sum.

Taichi's code generator lacks part of this mode, and stops the process where it does: no transcendental function, `abs`,
cast, comparison result, unary minus or `+=` on a whole vector, and no load or store of a whole vector field. Hence it is
switched on only while a kernel written for it is compiled, never for a scene's other kernels. Without Taichi's own
optimisation (`quick_compilation`) such kernels compute wrong numbers and say nothing: the two must not meet. Parts of a vector
field that keeps its vectors together are reached by `field.get_scalar_field(lane)[i]` alone; then eight of them are one load.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import taichi as ti

_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div)
_ALLOWED = (ast.BinOp, ast.Name, ast.Constant, ast.Attribute, ast.Return, ast.Assign, ast.Load, ast.Store, *_OPERATORS)


@contextmanager
def explicit_vectors() -> Iterator[None]:
    """Compile the kernels first called inside with vectors kept whole (CPU only; part of the key of Taichi's cache)."""
    config = ti.lang.impl.current_cfg()
    before = config.real_matrix_scalarize
    config.real_matrix_scalarize = False
    try:
        yield
    finally:
        config.real_matrix_scalarize = before


def require_components_apart(state: Any, names: Sequence[str]) -> None:
    """TypeError unless these vectors of a state are stored component by component (`ti.Layout.SOA`)."""
    for name in names:
        field = getattr(state, name)
        if field.get_scalar_field(0).parent() == field.get_scalar_field(1).parent():
            raise TypeError(f"explicit vectors need {' and '.join(names)} stored component by component")


def is_elementwise(formula: Callable[..., Any]) -> bool:
    """Whether a formula may be given a vector of lanes in place of a number: it only adds, subtracts, multiplies, divides.

    False also where the source cannot be read; the formula is then called once per lane, which is always right.
    """
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(formula)))
    except (OSError, TypeError, SyntaxError):
        return False
    function = tree.body[0]
    if not isinstance(function, ast.FunctionDef):
        return False
    statements = [s for s in function.body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))]
    return all(isinstance(node, _ALLOWED) for statement in statements for node in ast.walk(statement))
