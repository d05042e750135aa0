"""Launching a kernel again with other numbers, without the way through Taichi's Python that its first launch takes.

Taichi 1.7.4 takes tens of microseconds from the call of a kernel to the device. It finds for which objects the kernel was
compiled, makes functions for every kind of argument, and asks the compiler for the result, which is already there. Worker
threads that wait so long fall asleep, and waking them takes longer still: the forces of a thousand bodies took twice the time
of their loops. The kernels of a class (`ti.data_oriented`) are bound as Python binds methods.
"""

import functools
import weakref
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

MOST = 1000  # compiled forms that are kept of one kernel
ALSO_SHORT = {"taichi._kernels"}  # further modules whose kernels take the short way: Taichi's own, which fill and copy fields
PLAIN = (int, float, bool, str, type(None))  # template arguments that are compared by value
MOST_ENTRIES = 2**31 - 1  # of an array; Taichi warns of longer arrays, which its indices do not reach


class Launches:
    """The compiled forms of one kernel by its template arguments.

    Arrays of NumPy are told apart by their number type and the count of their axes, as Taichi compiles for these. A kernel of
    another package, or a kernel with other arguments than template arguments, numbers and arrays, is not `simple` and is
    launched by Taichi.
    """

    def __init__(self, kernel: Any) -> None:
        """Without any compiled form."""
        from taichi.lang import kernel_impl
        from taichi.lang.matrix import VectorType
        from taichi.types.ndarray_type import NdarrayType

        self.compiled = kernel.compiled_kernels  # another dictionary after Taichi was reset
        self.known: dict[tuple, tuple] = {}
        self.count = len(kernel.arguments)
        self.templates: list[int] = []
        self.numbers: list[tuple[int, bool, str, int]] = []  # place among the arguments, whether a float, how it is set, slot
        self.arrays: list[tuple[int, int]] = []  # place among the arguments, slot
        self.simple = is_ours(kernel.func) and kernel.autodiff_mode == kernel_impl.AutodiffMode.NONE
        self.returned: list[tuple[str, int]] = []  # for each result: its getter, and the length of a vector
        for kind in kernel.return_type or ():
            scalar, entries = (kind.dtype, kind.n) if isinstance(kind, VectorType) else (kind, 0)
            if name := _name_of(scalar):
                self.returned.append((f"get_struct_ret_{name}", entries))
            else:
                self.simple = False
        for place, argument in enumerate(kernel.arguments):
            kind, slot = argument.annotation, place - len(self.templates)
            if isinstance(kind, kernel_impl.template):
                self.templates.append(place)
            elif name := _name_of(kind):
                self.numbers.append((place, name == "float", f"set_arg_{name}", slot))
            elif isinstance(kind, NdarrayType) and (kind.dtype is None or _name_of(kind.dtype)):
                self.arrays.append((place, slot))
            else:
                self.simple = False

    def find(self, arguments: tuple) -> tuple[tuple, tuple | None]:
        """Key of the template arguments and the arrays, and the form that was compiled for them."""
        objects = [arguments[place] for place in self.templates]
        key = (*map(_key_of, objects), *[(arguments[place].dtype, arguments[place].ndim) for place, _ in self.arrays])
        found = self.known.get(key)
        if found is not None and any(known() is not each for known, each in zip(found[0], _flat(objects)) if known is not None):
            return key, None  # a new object at the address of an object that is gone
        return key, found

    def remember(self, kernel: Any, key: tuple, arguments: tuple) -> None:
        """Keep the form that Taichi has just compiled and launched, unless one of its objects takes no weak reference."""
        objects = _flat([arguments[place] for place in self.templates])
        try:
            alive = [None if type(each) in PLAIN else weakref.ref(each) for each in objects]
        except TypeError:
            return
        if kernel.has_print:
            self.simple = False
            return
        if len(self.known) >= MOST:
            self.known.clear()  # most forms belong to objects that are gone
        program = kernel.runtime.prog
        made = kernel.compiled_kernels[kernel.ensure_compiled(*arguments)]
        self.known[key] = alive, made, program.compile_kernel(program.config(), program.get_device_caps(), made)

    def fits(self, arguments: tuple) -> bool:
        """Whether numbers are plain numbers of Python, and arrays contiguous arrays of NumPy; otherwise Taichi takes over."""
        return all(
            isinstance(arguments[place], int) or (is_float and isinstance(arguments[place], float))
            for place, is_float, _, _ in self.numbers
        ) and all(
            type(arguments[place]) is np.ndarray
            and arguments[place].flags.c_contiguous
            and arguments[place].size <= MOST_ENTRIES
            for place, _ in self.arrays
        )


def _key_of(argument: Any) -> Any:
    """What a template argument is recognized by: its value, the address of an object, or the keys of the parts of a tuple."""
    if type(argument) in PLAIN:
        return type(argument), argument
    return tuple(map(_key_of, argument)) if type(argument) is tuple else id(argument)


def _flat(arguments: Iterable) -> list:
    """The arguments, with the parts of a tuple in its place."""
    return [part for each in arguments for part in (_flat(each) if type(each) is tuple else (each,))]


def is_ours(made: Any) -> bool:
    """Whether a function or a class belongs to this package or to `ALSO_SHORT`; all others are left to Taichi."""
    module = str(made.__module__)
    return module.split(".")[0] == "mpp_taichi" or module in ALSO_SHORT


def _name_of(kind: Any) -> str:
    """The name of a type of numbers in the functions of a launch context; empty where it is no type of numbers."""
    from taichi.lang import kernel_impl

    types = kernel_impl.primitive_types
    if id(kind) in types.real_type_ids:
        return "float"
    if id(kind) in types.integer_type_ids:
        return "int" if kernel_impl.is_signed(kernel_impl.cook_dtype(kind)) else "uint"
    return ""


def install() -> None:
    """Let kernels remember how they were launched, and classes bind their kernels without Taichi's search."""
    import taichi
    from taichi.lang import kernel_impl

    kernel = kernel_impl.Kernel
    kernel.__call__ = _remembering(kernel.__call__, kernel_impl.handle_exception_from_cpp)
    taichi.data_oriented = _binding(kernel_impl.data_oriented, kernel_impl._BoundedDifferentiableMethod)


class _ClassKernel:
    """A kernel among the attributes of a class; an object that is asked for it gives the kernel bound to the object."""

    def __init__(self, kernel: Any, bound: Callable) -> None:
        self.kernel, self.bound = kernel, bound

    def __get__(self, owner: Any, kind: type | None = None) -> Any:
        if owner is None:
            return self.kernel
        found = self.bound(owner, self.kernel)
        found.__name__ = self.kernel.__name__
        return found


def _binding(plain: Callable, bound: Callable) -> Callable:
    """`data_oriented` without its cost: to bind kernels, Taichi examines in Python every attribute that is read."""

    @functools.wraps(plain)
    def data_oriented(cls: Any) -> Any:
        # A base class that was marked before the installation looks up attributes in Taichi's way, and its properties would
        # win over those of this class.
        if not is_ours(cls) or cls.__getattribute__ is not object.__getattribute__:
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
    """A returned number, or a returned vector as a list of numbers.

    Taichi takes 60 µs to make a vector of its own, and for each number 4 µs to search for its type among all types.
    """
    if entries:
        return [getattr(context, getter)((place, entry)) for entry in range(entries)]
    return getattr(context, getter)((place,))


def _remembering(plain: Callable, told: Callable[[Exception], Exception]) -> Callable:
    """`Kernel.__call__`, which takes the short way for a form that is known."""

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
        for place, _, setter, slot in launches.numbers:
            getattr(context, setter)((slot,), arguments[place])
        for place, slot in launches.arrays:
            array = arguments[place]
            context.set_arg_external_array_with_shape((slot,), array.ctypes.data, array.nbytes, array.shape, 0)
        try:
            runtime.prog.launch_kernel(found[2], context)
        except Exception as error:
            raise told(error) from None
        if not launches.returned:
            return None
        runtime.prog.synchronize()
        parts = [_returned(context, place, *returned) for place, returned in enumerate(launches.returned)]
        return parts[0] if len(parts) == 1 else parts

    return call
