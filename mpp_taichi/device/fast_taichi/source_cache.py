"""A faster front end of Taichi: what it asks of source texts again and again is remembered, with the same answers.

Taichi 1.7.4 compiles a function anew at each of its calls in a kernel, and for every expression of it wraps the source line for
an error message that is hardly ever printed: more than half of the time before anything reaches the compiler proper. For every
field it formats the whole stack of calls, source lines and all, in case that field is never placed.
"""

import functools
import sys
import textwrap
from types import SimpleNamespace
from typing import Any

REMEMBERED = 1 << 16  # texts; a composed step has some thousand


def remember_sources() -> None:
    """Let Taichi's front end remember; where another version has other names, it stays as it is."""
    from taichi.lang import impl, kernel_impl, snode
    from taichi.lang.ast.ast_transformer_utils import ASTTransformerContext

    plain = getattr(ASTTransformerContext, "get_pos_info", None)
    if plain is None or not hasattr(kernel_impl, "getsourcelines") or hasattr(plain, "__wrapped__"):
        return
    remember = functools.lru_cache(REMEMBERED)
    kernel_impl.getsourcelines = remember(kernel_impl.getsourcelines)
    kernel_impl.getsourcefile = remember(kernel_impl.getsourcefile)
    kernel_impl.textwrap = SimpleNamespace(fill=remember(textwrap.fill), dedent=remember(textwrap.dedent))
    ASTTransformerContext.get_pos_info = _remembering(plain)
    for module in (impl, snode):
        if hasattr(module, "get_traceback"):
            module.get_traceback = _caller


def _caller(stacklevel: int = 1) -> str:
    """Where a field is declared, `stacklevel` calls further out than in the function that asks."""
    frame = sys._getframe(1)
    for _ in range(stacklevel):
        frame = frame.f_back or frame
    return f'File "{frame.f_code.co_filename}", line {frame.f_lineno}, in {frame.f_code.co_name}\n'


def _remembering(plain: Any) -> Any:
    """`get_pos_info`, asked once for each place in a source file."""
    known: dict[tuple, str] = {}

    @functools.wraps(plain)
    def get_pos_info(self: Any, node: Any) -> str:
        place = (node.lineno, node.end_lineno, node.col_offset, node.end_col_offset)
        key = (self.func.func, type(node), place)
        if key not in known:
            if len(known) >= REMEMBERED:
                known.clear()
            known[key] = plain(self, node)
        return known[key]

    return get_pos_info
