"""Compile mode: two options of Taichi's compiler, set together for the kernels that are first called inside.

`opt_level` 0 leaves out Taichi's own optimisation (quick_compilation.py); `real_matrix_scalarize` False keeps vectors whole
(explicit_vectors.py). An early form of the Taylor step, compiled with both, computed wrong numbers without a message. The pair
sum, the tree and the steps of today give the same bits with both, but Taichi tests no such kernel. Therefore a mode always sets
both options: of two modes, one inside the other, only the inner mode holds, and no kernel is compiled with both.

Both options are part of the key under which Taichi's offline cache keeps a kernel.
"""

from types import TracebackType

from mpp_taichi.device import own_runtime

Options = tuple[int, bool]
TAICHIS_OWN: Options = (1, True)
"""`opt_level` and `real_matrix_scalarize` as Taichi sets them."""


def leave_all() -> None:
    """Give the compiler Taichi's own options: the block of a mode may have been interrupted before it gave them back."""
    config = own_runtime.config()
    config.opt_level, config.real_matrix_scalarize = TAICHIS_OWN


class CompileMode:
    """A context in which both options have the values of the mode; until a mode is given values, they are Taichi's own."""

    def __init__(self) -> None:
        """A mode that changes nothing."""
        self._options = TAICHIS_OWN
        self._before: list[Options] = []

    def use(self, *, opt_level: int, real_matrix_scalarize: bool) -> None:
        """Set the options from now on.

        Raises:
            ValueError: the mode would leave out Taichi's own optimisation and keep vectors whole.
        """
        if opt_level == 0 and not real_matrix_scalarize:
            raise ValueError("kernels that keep vectors whole are compiled with Taichi's own optimisation")
        self._options = opt_level, real_matrix_scalarize

    def __enter__(self) -> None:
        config = own_runtime.config()
        self._before.append((config.opt_level, config.real_matrix_scalarize))
        config.opt_level, config.real_matrix_scalarize = self._options

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        config = own_runtime.config()
        config.opt_level, config.real_matrix_scalarize = self._before.pop()
