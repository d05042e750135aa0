"""Compiling long kernels in a tenth of the time.

A whole implicit step or a whole contact solver in one kernel is long. Taichi's own optimisation of such a kernel takes four to
eight times as long as the rest of its compilation. It makes an implicit step a third faster, and contacts not at all.
"""

from mpp_taichi.device.fast_taichi.compile_mode import CompileMode

_mode = CompileMode()


def install() -> None:
    """Let `quick_compilation` have its effect."""
    _mode.use(opt_level=0, real_matrix_scalarize=True)


def quick_compilation() -> CompileMode:
    """Compile the kernels that are first called inside without Taichi's own optimisation; LLVM still optimises them."""
    return _mode
