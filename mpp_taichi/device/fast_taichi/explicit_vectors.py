"""Explicit vectors: kernels in which a `ti.Vector` becomes a vector register of the CPU.

Taichi normally takes every vector apart into numbers and leaves it to LLVM to find the vectors again. LLVM 15 does not know the
newer processors and then uses 128 of their 512 bits. Under `explicit_vectors()` a `ti.Vector` of 8 or 16 lanes is one LLVM
vector from end to end, for any processor: the pair sum becomes three to four times as fast.

Taichi's code generator lacks part of this mode, and ends the process where a kernel needs the missing part: a transcendental
function, `abs`, a cast, the result of a comparison, a unary minus or `+=` on a whole vector, and a load or store of a whole
vector of a field. Hence the mode is switched on only while a kernel written for it is compiled, never for a scene's other
kernels. It does not hold together with `quick_compilation` (see compile_mode.py). A load or store of a component of a vector
field whose components are interleaved is wrong in this mode without a message (`require_components_apart` refuses such fields).
A component of a vector field that keeps its vectors together is reached by `field.get_scalar_field(lane)[i]` only; eight
components are then one load.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Sequence
from typing import Any

from mpp_taichi.device.fast_taichi.compile_mode import CompileMode

_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div)
_ALLOWED = (ast.BinOp, ast.Name, ast.Constant, ast.Attribute, ast.Return, ast.Assign, ast.Load, ast.Store, *_OPERATORS)
_mode = CompileMode()


def install() -> None:
    """Let `explicit_vectors` have its effect."""
    _mode.use(opt_level=1, real_matrix_scalarize=False)


def explicit_vectors() -> CompileMode:
    """Compile the kernels that are first called inside with vectors kept whole (CPU only)."""
    return _mode


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
