"""Asking for memory before it is needed: the processor fetches a line of it and goes on, which Taichi has no word for."""

from pathlib import Path

import taichi as ti

from mpp_taichi.device.fast_taichi import bitcode
from mpp_taichi.types import Template

SOURCE = Path(__file__).with_suffix(".ll")


@ti.func
def prefetch(field: Template, i):
    """Have the line of memory fetched where `field[i]` begins, of an index that is there; nothing on other processors."""
    if ti.static(bitcode.on_linux_x64()):
        address = ti.get_addr(field, i)
        ti.static(bitcode.call(SOURCE, "prefetch", address))
