"""Loops over few particles run on the calling thread, which finishes them before a second thread is awake.

One of Taichi's worker threads takes 25 to 100 µs to wake up, for every parallel loop of a kernel, and the calling thread sleeps
meanwhile; a loop over a thousand particles takes a fraction of this time. A loop shared among the threads of worker_threads.py
costs 2 µs, and the time of a wake-up after a pause.
"""

from types import TracebackType
from typing import Any

import taichi as ti

from mpp_taichi.device import own_runtime

FEW = 4096  # particles: a loop of 15 ns for each is done in 60 µs


class SerialLoops:
    """Within this context kernels are compiled as though each of their loops had `ti.loop_config(serialize=True)` before it.

    A compiled kernel stays as it is, so the context is for kernels that are always launched within it. Their results equal
    the results of parallel loops, provided that the iterations of each loop may come in any order.
    """

    depth = 0  # how many of these contexts are entered
    counted = 0  # 1 once `install` has replaced Taichi's reading of loops; until then a context has no effect

    def __enter__(self) -> None:
        SerialLoops.depth += SerialLoops.counted

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        SerialLoops.depth -= SerialLoops.counted


def leave_all() -> None:
    """Make later loops parallel again: a block of `SerialLoops` may have been interrupted before it was left."""
    SerialLoops.depth = 0


def on_cpu() -> bool:
    """Whether the backend that runs is a CPU: its threads are few and fast, and a loop on it may take as long as it likes."""
    return own_runtime.config().arch in (ti.x64, ti.arm64)


def is_short(count: int) -> bool:
    """Whether a loop of so many particles is done on the calling thread before another thread of a CPU is awake."""
    return count <= FEW and on_cpu()


class _LoopReader:
    """Taichi's reading of a `for` statement; before an outermost loop it asks whether the loop must be serial."""

    def __init__(self, transformer: Any) -> None:
        self.transformer, self.plain = transformer, transformer.build_For
        self.loops = 0  # around the loop that is read

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


def install() -> None:
    """Replace Taichi's reading of loops, so that `SerialLoops` has its effect."""
    from taichi.lang.ast.ast_transformer import ASTTransformer

    ASTTransformer.build_For = staticmethod(_LoopReader(ASTTransformer))
    SerialLoops.counted = 1
