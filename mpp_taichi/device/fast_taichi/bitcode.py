"""Functions in LLVM's own bitcode called from kernels: what Taichi has no word for.

Taichi 1.7 links the file into the kernel it compiles and optimises both together. The files lie beside their sources, which
tools/make/assemble_bitcode.py makes them from.
"""

import sys
from functools import cache
from pathlib import Path
from typing import Any


@cache
def bitcode(source: Path) -> str:
    """Path of what a source was assembled to; Taichi's cache knows it by name, so that has a digest of the source in it."""
    return str(next(source.parent.glob(f"{source.stem}_*.bc")))


def on_linux_x64() -> bool:
    """Whether the kernel that is compiled now is for the system and processor that the files were assembled for."""
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
    """Have the kernel that is compiled call a function with pointers to local variables of it; within `ti.static`."""
    from taichi._lib import core
    from taichi.lang import impl
    from taichi.lang.expr import make_expr_group

    runtime = impl.get_runtime()
    where = core.DebugInfo(runtime.get_current_src_info())
    runtime.compiling_callable.ast_builder().insert_external_func_call(
        0, "", bitcode(source), name, make_expr_group(variables), make_expr_group([]), where
    )
