"""Loops of few particles on the calling thread: it has done them before another one is awake.

A worker of Taichi takes 25 to 100 µs to wake, for every parallel loop of a kernel, and the thread that called sleeps meanwhile;
a loop over a thousand particles takes a fraction of that. Those of worker_threads.py cost 2 µs, and a wake-up after a pause.
"""

from types import TracebackType
from typing import Any

import taichi as ti

FEW = 4096  # particles: a loop of 15 ns for each is done in 60 µs


class SerialLoops:
    """Within this, kernels are compiled as though each of their loops had `ti.loop_config(serialize=True)` before it.

    For kernels that are launched in no other way, as what was compiled stays. Their results are those of parallel loops, as far
    as the loops' iterations may come in any order.
    """

    depth = 0

    def __enter__(self) -> None:
        SerialLoops.depth += 1

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        SerialLoops.depth -= 1


def on_cpu() -> bool:
    """Whether the backend that runs is one whose threads are few and quick, and may loop as long as they like."""
    return ti.lang.impl.current_cfg().arch in (ti.x64, ti.arm64)


def loop_grain() -> int:
    """Iterations of a parallel loop for each heavy one, as Taichi gives no CPU thread fewer; a kernel asks while compiled."""
    return 512 if on_cpu() and SerialLoops.depth == 0 else 1


class _Reader:
    """Taichi's reading of a `for`: the outermost one of a kernel asks whether we are within."""

    def __init__(self, transformer: Any) -> None:
        self.transformer, self.plain = transformer, transformer.build_For
        self.loops = 0  # around the one that is read

    def __call__(self, context: Any, node: Any) -> Any:
        if SerialLoops.depth == 0 or self.transformer.get_decorator(context, node.iter) == "static":
            return self.plain(context, node)
        if self.loops == 0:
            ti.lang.impl.get_runtime().compiling_callable.ast_builder().strictly_serialize()
        self.loops += 1
        try:
            return self.plain(context, node)
        finally:
            self.loops -= 1


def _teach() -> None:
    from taichi.lang.ast.ast_transformer import ASTTransformer

    ASTTransformer.build_For = staticmethod(_Reader(ASTTransformer))


_teach()
