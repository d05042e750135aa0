"""How a thread on a device of many learns that its loops were ended."""

import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import on_cpu

TURNS = 3  # of a loop that a device which ends loops cuts down to one


@ti.data_oriented
class LoopWatch:
    """Tells a thread at its end whether all its loops came to theirs.

    Software Vulkan ends every loop of a thread once they have made 65,535 iterations together, and says nothing. From then on
    a loop makes one iteration, also the one that is asked here, whose length no compiler knows.

    on_cpu   there nothing is watched, and what is a thread's work runs in a serialized loop, at once; elsewhere in a parallel
             loop of one iteration, because software Vulkan lets the idle lanes beside a serialized loop run wild
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
        """Whether loops of this thread were ended before their end."""
        stopped = False
        if ti.static(not self.on_cpu):
            count = 0
            for _ in range(self.turns[0]):
                count += 1
            stopped = count != TURNS
        return stopped
