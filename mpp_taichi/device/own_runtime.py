"""Own runtime: whether this package started the runtime of Taichi that exists now, and what becomes of one that has ended.

A process has one runtime of Taichi. Each ti.init and ti.reset ends it, whoever calls them. A field of a runtime that has ended
keeps an address of memory that was given back, and Taichi 1.7.4 ends the process where such a field is read, written or handed
to a kernel. A kernel of this package would also be compiled anew, in the precision of the program that called ti.init.

Therefore a field whose runtime has ended raises MppError at every use. These are the fields of every runtime that this package
started, and the fields of another runtime that a start of this package ends. A kernel of this package raises MppError before it
is compiled in a runtime of others. A launch of a compiled kernel costs nothing more: a new runtime has no compiled kernels.
"""

import functools
import gc
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

from mpp_taichi.device import one_thread
from mpp_taichi.errors import MppError

ONE_RUNTIME = "a process has one runtime of Taichi, which each ti.init and ti.reset ends, and so does a start of mpp_taichi"

ENDED = f"this field of Taichi has ended: {ONE_RUNTIME}; make the field again after the last start"


class _Own:
    impl: Any = None  # Taichi's module of the runtime, once `install` was called
    runtime: Any = None  # Taichi's object of the runtime that this package started last
    starts: bool = False  # whether this package is starting a runtime now
    fields: weakref.WeakSet[Any] = weakref.WeakSet()  # of the runtime that exists
    trees: weakref.WeakSet[Any] = weakref.WeakSet()  # the memory of its fields


class EndedField:
    """A field whose runtime has ended: every use of it raises MppError."""

    def __getattribute__(self, name: str) -> NoReturn:
        """Raise the error, whichever attribute is asked for."""
        raise MppError(ENDED)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        """Raise the error."""
        raise MppError(ENDED)

    def __getitem__(self, key: Any) -> NoReturn:
        """Raise the error."""
        raise MppError(ENDED)

    def __setitem__(self, key: Any, value: Any) -> NoReturn:
        """Raise the error."""
        raise MppError(ENDED)

    def __repr__(self) -> str:
        """Say what it is; a debugger asks for it."""
        return "<a field of Taichi that has ended>"


def install() -> None:
    """Watch the fields, the kernels and the ends of Taichi's runtimes."""
    from taichi._snode.snode_tree import SNodeTree
    from taichi.lang import impl, kernel_impl
    from taichi.lang.field import Field

    if impl.get_runtime().prog is not None:  # the program has started Taichi before, and may have fields
        for each in gc.get_objects():
            if issubclass(type(each), (Field, SNodeTree)):
                (_Own.fields if issubclass(type(each), Field) else _Own.trees).add(each)
    Field.__init__ = _noting(Field.__init__, _Own.fields)
    SNodeTree.__init__ = _noting(SNodeTree.__init__, _Own.trees)
    impl.reset = _ending(impl.reset)
    _Own.impl = impl
    kernel_impl.Kernel.materialize = _guarding(kernel_impl.Kernel.materialize)


def is_own() -> bool:
    """Whether the runtime that exists now was started by this package."""
    return _Own.runtime is not None and _Own.impl.get_runtime() is _Own.runtime


def exists() -> bool:
    """Whether a runtime exists now that this package started."""
    return _Own.impl is not None and _Own.impl.get_runtime().prog is not None and is_own()


def config() -> Any:
    """The settings of the runtime that exists now; MppError where there is none, which the program has ended."""
    program = _Own.impl.get_runtime().prog
    if program is None:
        raise MppError(ENDED)
    return program.config()


def has_foreign_fields() -> bool:
    """Whether a start by this package would end a runtime of others with fields in it."""
    return not is_own() and _Own.impl.get_runtime().prog is not None and len(_Own.fields) > 0


def end_fields() -> None:
    """Let every use of the fields that exist now raise MppError, and let go of the runtime that they had.

    A closed Simulation that the program still holds would otherwise keep the compiler of its runtime, with memory and threads.
    """
    for field in list(_Own.fields):
        field.__dict__.clear()
        field.__class__ = EndedField
    for kernel in _Own.impl.get_runtime().kernels:
        if kernel.func.__module__.startswith(("mpp_taichi.", "taichi.")):
            kernel.mapper.mapping.clear()  # which would keep every field that the kernel was ever called with
    for tree in list(_Own.trees):
        tree.prog = "ended"  # so that Taichi frees nothing of it in a later runtime
    _Own.fields.clear()
    _Own.trees.clear()


@contextmanager
def being_started() -> Iterator[None]:
    """A block in which this package calls ti.init; the runtime that exists at its end is its own."""
    _Own.starts = True
    try:
        yield
        _Own.runtime = _Own.impl.get_runtime()
        one_thread.take()
    finally:
        _Own.starts = False


def _noting(plain: Any, noted: weakref.WeakSet[Any]) -> Any:
    """The `__init__` of a class, which notes the object for the end of its runtime."""

    @functools.wraps(plain)
    def __init__(self: Any, *arguments: Any, **named: Any) -> None:
        plain(self, *arguments, **named)
        noted.add(self)

    return __init__


def _ending(plain: Any) -> Any:
    """`impl.reset`, through which go ti.reset and ti.init; it waits for its turn, and ends the fields of the runtime."""

    @functools.wraps(plain)
    def reset() -> None:
        with one_thread.lock:
            ends = _Own.starts or is_own()
            plain()
            if ends:
                end_fields()
            _Own.fields.clear()
            _Own.trees.clear()

    return reset


def _guarding(plain: Any) -> Any:
    """`Kernel.materialize`, which compiles a kernel: a kernel of this package only in a runtime that the package started."""
    from taichi.lang.exception import TaichiCompilationError

    @functools.wraps(plain)
    def materialize(self: Any, *arguments: Any, **named: Any) -> Any:
        if not (is_own() or _Own.starts) and self.func.__module__.startswith("mpp_taichi."):
            raise MppError(f"the runtime of this kernel of mpp_taichi has ended: {ONE_RUNTIME}; make a new Simulation")
        try:
            return plain(self, *arguments, **named)
        except TaichiCompilationError as error:  # what is raised while a kernel is read, Taichi only quotes
            raise MppError(ENDED) if ENDED in str(error) else error from None

    return materialize
