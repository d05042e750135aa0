"""Compiled phases: each phase that a run has come to, compiled once; phases of the same kernels share one."""

from collections.abc import Collection, Sequence

from mpp_taichi.device.backends import Device
from mpp_taichi.device.interrupted import tidied_after
from mpp_taichi.simulation.compiled_phase import CompiledPhase
from mpp_taichi.simulation.course import Phase
from mpp_taichi.snapshot import Snapshot


class CompiledPhases:
    """Compiles phases when a run comes to them, all for one device and under the plan that was asked for."""

    def __init__(self, device: Device, *, plan: str, replica_starts: Sequence[Snapshot], event_log: bool) -> None:
        """Nothing is compiled yet."""
        self._device, self._replica_starts, self._event_log = device, tuple(replica_starts), event_log
        self.plan_asked = plan
        self._of_kernels: dict[object, CompiledPhase] = {}

    def __len__(self) -> int:
        """Number of compiled phases."""
        return len(self._of_kernels)

    def of(self, phase: Phase) -> CompiledPhase:
        """The compiled phase with the numbers of this one; BackendError, CapacityError, … where it cannot be compiled."""
        if phase.kernels not in self._of_kernels:
            with tidied_after():
                self._of_kernels[phase.kernels] = CompiledPhase(
                    phase, self._device, plan=self.plan_asked, replica_starts=self._replica_starts, event_log=self._event_log
                )
        compiled = self._of_kernels[phase.kernels]
        compiled.adopt(phase)
        return compiled

    def holds(self, phase: Phase, compiled: CompiledPhase) -> bool:
        """Whether the phase is still compiled to this."""
        return self._of_kernels.get(phase.kernels) is compiled

    def set_aside(self, phases: Collection[Phase]) -> dict[object, CompiledPhase]:
        """Keep the kernels of these phases only, and return all that there were: for `put_back`, or for `drop`."""
        before, kept = self._of_kernels, {phase.kernels for phase in phases}
        self._of_kernels = {kernels: each for kernels, each in before.items() if kernels in kept}
        return before

    def put_back(self, before: dict[object, CompiledPhase]) -> None:
        """Undo `set_aside`."""
        self._of_kernels = before

    def drop(self, before: dict[object, CompiledPhase]) -> None:
        """Give the device memory back of the compiled phases that `set_aside` did not keep."""
        for kernels, each in before.items():
            if kernels not in self._of_kernels:
                each.destroy()

    def destroy(self) -> None:
        """Give all device memory back."""
        for each in self._of_kernels.values():
            each.destroy()
