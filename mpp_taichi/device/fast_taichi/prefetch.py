"""Asking for memory before it is needed: the processor fetches a line of it and goes on, for which Taichi has no function."""

from pathlib import Path

import taichi as ti

from mpp_taichi.device.fast_taichi import bitcode, switch
from mpp_taichi.types import Template

SOURCE = Path(__file__).with_suffix(".ll")


@ti.func
def prefetch(field: Template, i):
    """Have the line of memory fetched in which `field[i]` begins; i must be a valid index. On other processors: nothing."""
    if ti.static(switch.is_on("prefetch") and bitcode.on_linux_x64()):
        address = ti.get_addr(field, i)
        ti.static(bitcode.call(SOURCE, "prefetch", address))
