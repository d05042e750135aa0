"""Finite check: whether every position and velocity is a finite number."""

from typing import Any

import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import is_short
from mpp_taichi.state.state import State
from mpp_taichi.types import Template


@ti.data_oriented
class FiniteCheck:
    """The search for the first particle that is not finite."""

    def __init__(self, state: State) -> None:
        """Bind the state; the kernel is compiled when it is first used."""
        self.state = state
        self._bad: Any = ti.field(ti.i32, shape=())

    def first_bad_particle(self) -> int:
        """Index of the first particle whose position or velocity is not finite, or −1. Waits for the device."""
        found = int(self._find_bad(is_short(self.state.total_count)))
        return found if found < self.state.total_count else -1

    @ti.kernel
    def _find_bad(self, serial: Template) -> ti.i32:
        self._bad[None] = self.state.total_count
        ti.loop_config(serialize=serial)  # no other thread is woken for few particles
        for i in range(self.state.total_count):
            bad = False
            for k in ti.static(range(self.state.dimensions)):
                x = self.state.position[i][k]
                v = self.state.velocity[i][k]
                # Comparisons with itself are folded away by the compiler; these are not.
                if ti.math.isnan(x) or ti.math.isinf(x) or ti.math.isnan(v) or ti.math.isinf(v):
                    bad = True
            if bad:
                ti.atomic_min(self._bad[None], i)
        return self._bad[None]
