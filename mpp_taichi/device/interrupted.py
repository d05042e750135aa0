"""Interrupted: what a call leaves behind in Taichi that an error or the user's Ctrl+C has ended at any place.

Taichi refuses to compile a kernel while it knows of fields that were never placed, and a compile mode or a serial loop that was
entered and not left would hold for all later kernels. The fields of a call that was ended are not needed any more.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mpp_taichi.device import one_thread

FIELDS = ("global_vars", "grad_vars", "dual_vars", "matrix_fields")


@contextmanager
def tidied_after() -> Iterator[None]:
    """A block after whose end by an exception Taichi knows only the unfinished fields and builders that it knew before.

    The block is not inside a block of a compile mode or of `SerialLoops`.
    """
    from taichi.lang import impl

    runtime = impl.get_runtime()
    known = set(runtime.unfinalized_fields_builder), {name: {id(each) for each in getattr(runtime, name)} for name in FIELDS}
    try:
        yield
    except BaseException:
        with one_thread.lock:
            _tidy(impl, *known)
        raise


def _tidy(impl: Any, builders: set[Any], fields: dict[str, set[int]]) -> None:
    from mpp_taichi.device.fast_taichi import compile_mode, serial_loops  # they import Taichi, which prints a banner then

    runtime = impl.get_runtime()
    for builder in set(runtime.unfinalized_fields_builder).difference(builders, {impl._root_fb}):
        del runtime.unfinalized_fields_builder[builder]
    for name, before in fields.items():
        setattr(runtime, name, [each for each in getattr(runtime, name) if id(each) in before])
    if runtime.prog is not None:
        compile_mode.leave_all()
    serial_loops.leave_all()
