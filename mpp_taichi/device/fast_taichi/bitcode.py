"""Functions in LLVM's own bitcode, called from kernels: operations for which Taichi has no function.

Taichi 1.7 links the file into the kernel that it compiles and optimises both together. Each file of bitcode lies beside its
source, from which tools/make/assemble_bitcode.py makes it.
"""

import sys
from functools import cache
from pathlib import Path
from typing import Any


@cache
def bitcode(source: Path) -> str:
    """Path of the bitcode of a source.

    Taichi's cache of kernels knows a file of bitcode by its name only, so the name has a digest of the source in it.
    """
    return str(next(source.parent.glob(f"{source.stem}_*.bc")))


def on_linux_x64() -> bool:
    """Whether the kernel that is compiled now is for the system and processor for which the files were assembled."""
    import taichi as ti

    return sys.platform == "linux" and ti.lang.impl.current_cfg().arch == ti.x64


@cache
def has_avx512() -> bool:
    """Whether this Linux runs on a processor with AVX-512."""
    try:
        return " avx512f " in Path("/proc/cpuinfo").read_text()
    except OSError:
        return False


def call(source: Path, name: str, *variables: Any) -> Any:
    """Make the kernel that is compiled call a function with pointers to local variables of the kernel; inside `ti.static`."""
    from taichi._lib import core
    from taichi.lang import impl
    from taichi.lang.expr import make_expr_group

    runtime = impl.get_runtime()
    where = core.DebugInfo(runtime.get_current_src_info())
    runtime.compiling_callable.ast_builder().insert_external_func_call(
        0, "", bitcode(source), name, make_expr_group(variables), make_expr_group([]), where
    )
