"""A faster front end of Taichi: answers about source texts, which it asks for again and again, are remembered.

Taichi 1.7.4 compiles a function anew at each of its calls in a kernel, and for every expression of the function it wraps the
source line for an error message that is hardly ever printed. This takes more than half of the time before a kernel reaches the
compiler proper. For every field it formats the whole stack of calls with their source lines, in case the field is never placed;
for the fields of this package the innermost call is enough. Each `ti.func` and `ti.kernel` asks in which line of its source a
frame is, to learn whether the function is in a class. Python searches all modules of the process for the answer, which takes
50 ms for the three hundred functions that are defined before a small scene takes its first step.
"""

import contextlib
import functools
import inspect
import linecache
import sys
import textwrap
from collections.abc import Callable, Iterator
from types import FrameType, SimpleNamespace
from typing import Any

REMEMBERED = 1 << 16  # texts; a composed step has some thousands
_search = inspect.getframeinfo


def install() -> None:
    """Let Taichi's front end remember."""
    from taichi.lang import impl, kernel_impl, snode
    from taichi.lang.ast.ast_transformer_utils import ASTTransformerContext

    remember = functools.lru_cache(REMEMBERED)
    kernel_impl.getsourcelines = remember(kernel_impl.getsourcelines)
    kernel_impl.getsourcefile = remember(kernel_impl.getsourcefile)
    kernel_impl.textwrap = SimpleNamespace(fill=remember(textwrap.fill), dedent=remember(textwrap.dedent))
    ASTTransformerContext.get_pos_info = _remembering(ASTTransformerContext.get_pos_info)
    for module in (impl, snode):
        module.get_traceback = _short_traceback(module.get_traceback)
    kernel_impl.inspect = SimpleNamespace(**vars(inspect) | {"getframeinfo": _frame_info})


@contextlib.contextmanager
def lines_read_directly() -> Iterator[None]:
    """A context in which Taichi is imported: its functions, too, learn their lines without a search."""
    inspect.getframeinfo = _frame_info
    try:
        yield
    finally:
        inspect.getframeinfo = _search


def _frame_info(frame: Any, context: int = 1) -> Any:
    """`inspect.getframeinfo`, without a search for the one line at which a frame is, where its file has the line."""
    if isinstance(frame, FrameType) and context == 1:
        code = frame.f_code
        line = linecache.getline(code.co_filename, frame.f_lineno, frame.f_globals)
        if line:
            return inspect.Traceback(code.co_filename, frame.f_lineno, code.co_name, [line], 0)
    return _search(frame, context)


def _short_traceback(plain: Callable[..., str]) -> Callable[..., str]:
    """`get_traceback`, which says where a field is declared: for calls from this package the innermost call only."""

    @functools.wraps(plain)
    def get_traceback(stacklevel: int = 1) -> str:
        frame = sys._getframe(1)
        for _ in range(stacklevel):
            frame = frame.f_back or frame
        return _place(frame) if _is_declared_here(frame) else plain(stacklevel + 1)

    return get_traceback


def _is_declared_here(frame: FrameType | None) -> bool:
    """Whether the innermost call outside of Taichi is a call by this package."""
    while frame is not None:
        package = str(frame.f_globals.get("__name__")).partition(".")[0]
        if package != "taichi":
            return package == "mpp_taichi"
        frame = frame.f_back
    return False


def _place(frame: FrameType) -> str:
    """The place of a call, as a traceback writes it."""
    return f'File "{frame.f_code.co_filename}", line {frame.f_lineno}, in {frame.f_code.co_name}\n'


def _remembering(plain: Any) -> Any:
    """`get_pos_info`, called once for each place in a source file."""
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
