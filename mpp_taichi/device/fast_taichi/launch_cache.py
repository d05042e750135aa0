"""Launching a kernel of Taichi again with other numbers, without the way through Python that its first launch takes.

Classes with kernels (`ti.data_oriented`) bind them as Python binds methods.

Taichi 1.7.4 takes tens of microseconds from a call to the device: it looks up for which objects the kernel was compiled, makes
functions for every kind of argument, and asks the compiler for the result that is there. Threads that wait so long fall asleep,
and waking them takes longer still: the forces of a thousand bodies took twice the time of their loops.
"""

import functools
import weakref
from collections.abc import Callable
from typing import Any

MOST = 1000  # forms of one kernel that are kept
ALSO_SHORT = {"taichi._kernels"}  # other modules whose kernels are launched the short way: Taichi's own fill and copy fields
PLAIN = (int, float, bool, str, type(None))  # template arguments that are compared by value


class Launches:
    """The compiled forms of one kernel by its template arguments.

    A kernel of another package, or a kernel that takes anything but template arguments and numbers, is not `simple`, and is
    left to Taichi.
    """

    def __init__(self, kernel: Any) -> None:
        """Nothing is known yet."""
        from taichi.lang import kernel_impl
        from taichi.lang.matrix import VectorType

        self.compiled = kernel.compiled_kernels  # another one after Taichi was reset
        self.known: dict[tuple, tuple] = {}
        self.count = len(kernel.arguments)
        self.templates: list[int] = []
        self.numbers: list[tuple[int, bool, str]] = []  # place among the arguments, whether it is a float, how it is set
        self.simple = is_ours(kernel.func) and kernel.autodiff_mode == kernel_impl.AutodiffMode.NONE
        self.returned: list[tuple[str, int]] = []  # how each is asked for, and of vectors the numbers of entries
        for kind in kernel.return_type or ():
            scalar, entries = (kind.dtype, kind.n) if isinstance(kind, VectorType) else (kind, 0)
            if name := _name_of(scalar):
                self.returned.append((f"get_struct_ret_{name}", entries))
            else:
                self.simple = False
        for place, argument in enumerate(kernel.arguments):
            if isinstance(argument.annotation, kernel_impl.template):
                self.templates.append(place)
            elif name := _name_of(argument.annotation):
                self.numbers.append((place, name == "float", f"set_arg_{name}"))
            else:
                self.simple = False

    def find(self, arguments: tuple) -> tuple[tuple, tuple | None]:
        """Key of the template arguments, and what was compiled for them."""
        objects = [arguments[place] for place in self.templates]
        key = tuple([(type(each), each) if type(each) in PLAIN else id(each) for each in objects])
        found = self.known.get(key)
        if found is not None and any(known() is not each for known, each in zip(found[0], objects) if known is not None):
            return key, None  # another object at the place of one that is gone
        return key, found

    def remember(self, kernel: Any, key: tuple, arguments: tuple) -> None:
        """Keep what Taichi has just compiled and launched; not where an object cannot be told from a later one."""
        objects = [arguments[place] for place in self.templates]
        try:
            alive = [None if type(each) in PLAIN else weakref.ref(each) for each in objects]
        except TypeError:
            return
        if kernel.has_print:
            self.simple = False
            return
        if len(self.known) >= MOST:
            self.known.clear()  # most are of objects that are gone
        program = kernel.runtime.prog
        made = kernel.compiled_kernels[kernel.ensure_compiled(*arguments)]
        self.known[key] = alive, made, program.compile_kernel(program.config(), program.get_device_caps(), made)

    def fits(self, arguments: tuple) -> bool:
        """Whether the numbers are plain ones; Taichi says what is wrong with others."""
        return all(
            isinstance(arguments[place], int) or (is_float and isinstance(arguments[place], float))
            for place, is_float, _ in self.numbers
        )


def is_ours(made: Any) -> bool:
    """Whether a function or a class is of this package, or has asked for short launches; others go Taichi's own way."""
    module = str(made.__module__)
    return module.split(".")[0] == "mpp_taichi" or module in ALSO_SHORT


def _name_of(kind: Any) -> str:
    """What launches call numbers of a type; empty where it is no type of numbers."""
    from taichi.lang import kernel_impl

    types = kernel_impl.primitive_types
    if id(kind) in types.real_type_ids:
        return "float"
    if id(kind) in types.integer_type_ids:
        return "int" if kernel_impl.is_signed(kernel_impl.cook_dtype(kind)) else "uint"
    return ""


def remember_launches() -> None:
    """Let kernels remember how they were launched; where another version of Taichi has other names, it stays as it is."""
    import taichi
    from taichi.lang import kernel_impl

    kernel = kernel_impl.Kernel
    if not hasattr(kernel.__call__, "remembers") and hasattr(kernel, "ensure_compiled"):
        kernel.__call__ = _remembering(kernel.__call__, kernel_impl.handle_exception_from_cpp)
        if hasattr(kernel_impl, "_BoundedDifferentiableMethod"):
            taichi.data_oriented = _binding(kernel_impl.data_oriented, kernel_impl._BoundedDifferentiableMethod)


class _ClassKernel:
    """A kernel among the attributes of a class: bound to an object when it is asked of one."""

    def __init__(self, kernel: Any, bound: Callable) -> None:
        self.kernel, self.bound = kernel, bound

    def __get__(self, owner: Any, kind: type | None = None) -> Any:
        if owner is None:
            return self.kernel
        found = self.bound(owner, self.kernel)
        found.__name__ = self.kernel.__name__
        return found


def _binding(plain: Callable, bound: Callable) -> Callable:
    """`data_oriented` without its price: to bind kernels, Taichi looks in Python at each attribute that is asked for."""

    @functools.wraps(plain)
    def data_oriented(cls: Any) -> Any:
        if not is_ours(cls):
            return plain(cls)
        others = [value for value in vars(cls).values() if isinstance(value, (property, staticmethod))]
        if any(hasattr(getattr(value, "fget", None) or value, "_is_wrapped_kernel") for value in others):
            return plain(cls)
        for name, value in list(vars(cls).items()):
            if hasattr(value, "_is_wrapped_kernel") and value._is_classkernel:
                value._is_staticmethod = False
                setattr(cls, name, _ClassKernel(value, bound))
        cls._data_oriented = True
        return cls

    return data_oriented


def _returned(context: Any, place: int, getter: str, entries: int) -> Any:
    """A number, or a vector as a list of numbers: to make its own vector of them takes Taichi 60 microseconds.

    Nor is Taichi asked for each number, which looks up its type among all types that there are for 4 microseconds.
    """
    if entries:
        return [getattr(context, getter)((place, entry)) for entry in range(entries)]
    return getattr(context, getter)((place,))


def _remembering(plain: Callable, told: Callable[[Exception], Exception]) -> Callable:
    """`Kernel.__call__`, by the short way where it is known."""

    @functools.wraps(plain)
    def call(self: Any, *arguments: Any, **named: Any) -> Any:
        launches = self.__dict__.get("launches")
        if launches is None or launches.compiled is not self.compiled_kernels:
            launches = self.launches = Launches(self)
        runtime = self.runtime
        short = launches.simple and not named and len(arguments) == launches.count
        if not short or runtime.target_tape or runtime.fwd_mode_manager or not launches.fits(arguments):
            return plain(self, *arguments, **named)
        key, found = launches.find(arguments)
        if found is None:
            result = plain(self, *arguments)
            launches.remember(self, key, arguments)
            return result
        context = found[1].make_launch_context()
        for slot, (place, _, setter) in enumerate(launches.numbers):
            getattr(context, setter)((slot,), arguments[place])
        try:
            runtime.prog.launch_kernel(found[2], context)
        except Exception as error:
            raise told(error) from None
        if not launches.returned:
            return None
        runtime.prog.synchronize()
        parts = [_returned(context, place, *returned) for place, returned in enumerate(launches.returned)]
        return parts[0] if len(parts) == 1 else parts

    call.remembers = True  # type: ignore[attr-defined]
    return call
