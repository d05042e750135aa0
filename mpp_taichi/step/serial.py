"""Serial: one thread takes many steps of the whole system in one launch."""

from typing import Any

import taichi as ti

from mpp_taichi.step.launcher import Launcher, measure_between
from mpp_taichi.types import Template


@ti.data_oriented
class Serial(Launcher):
    """The plan of small systems on a CPU: no thread waits for another one, and no launch for a step."""

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """One kernel for all steps."""
        with self.compiled():
            self._advance(time, dt, first, last)

    def launch_metered(self, time: float, dt: float, first: int, last: int, meter: Any) -> None:
        """The kernel measures after each of its steps, unless the device limits the loops of a kernel."""
        if not meter.in_kernel:
            measure_between(self, time, dt, first, last, meter)
            return
        with self.parts.quickly():
            self._advance_metered(time, dt, first, last, meter)

    @ti.kernel
    def _advance(self, time: float, dt: float, begin: ti.i32, end: ti.i32):
        ti.loop_config(serialize=True)
        for s in range(begin, end):
            self.integrator.step(self.state, self.total_force, 0, time + s * dt, dt, "serial")

    @ti.kernel
    def _advance_metered(self, time: float, dt: float, begin: ti.i32, end: ti.i32, meter: Template):
        ti.loop_config(serialize=True)
        for s in range(begin, end):
            self.integrator.step(self.state, self.total_force, 0, time + s * dt, dt, "serial")
            meter.store(s - begin, 0, time + (s + 1) * dt)
