"""Compiling steps in half of the time, for runs that are too short to earn the rest of it.

Taichi follows every number of a kernel from where it is stored to where it is loaded again (its analysis of the control flow).
This takes half to two thirds of the compile time of a long step. A step that was compiled without it computes the same bits,
and takes up to a tenth longer.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from mpp_taichi.device import own_runtime
from mpp_taichi.device.fast_taichi import switch

OPTION = "cfg_optimization"  # Taichi's name of the analysis, in its settings
_mode = {"short": False}


def analyses() -> bool:
    """Whether a runtime that starts now is to compile with the analysis."""
    return not _mode["short"]


@contextmanager
def short_compilation() -> Iterator[None]:
    """Compile the kernels that are first called inside without the analysis, also in a runtime that starts inside."""
    before = _mode["short"]
    _set(short=switch.is_on("short_compilation"))
    try:
        yield
    finally:
        _set(short=before)


def _set(*, short: bool) -> None:
    _mode["short"] = short
    if own_runtime.exists():
        setattr(own_runtime.config(), OPTION, not short)
