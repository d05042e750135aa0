"""A watch by which a thread on a device of many threads detects that the driver ended its loops early."""

import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import on_cpu

TURNS = 3  # of the test loop, which makes only one turn after the driver has ended a loop


@ti.data_oriented
class LoopWatch:
    """Detects, at the end of a thread's work, whether all loops of the thread made all of their iterations.

    Software Vulkan ends the loops of a thread without an error once they have made 65,535 iterations together. After this
    every loop makes one iteration only, also the test loop of this class, whose length the compiler does not know.

    on_cpu   on the CPU no loop is ended early, so nothing is tested, and the work of one thread runs in a serialized loop. On
             other devices it runs in a parallel loop of one iteration, because the idle lanes beside a serialized loop of
             software Vulkan do not stop
    """

    def __init__(self) -> None:
        """Allocate; needs a started Taichi."""
        self.on_cpu = on_cpu()
        self.turns = ti.field(ti.i32)
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, 1).place(self.turns)
        self._tree = builder.finalize()
        if not self.on_cpu:
            self.turns.fill(TURNS)

    def destroy(self) -> None:
        """Give the memory back."""
        self._tree.destroy()

    @ti.func
    def was_stopped(self):
        """Whether the driver ended loops of this thread early."""
        stopped = False
        if ti.static(not self.on_cpu):
            count = 0
            for _ in range(self.turns[0]):
                count += 1
            stopped = count != TURNS
        return stopped
