"""Run loop: launches between the samples of the recorders, through one phase after another."""

import math
from collections.abc import Sequence
from typing import Any

from mpp_taichi.device import one_thread
from mpp_taichi.device.interrupted import tidied_after
from mpp_taichi.simulation.in_turn import require_life
from mpp_taichi.simulation.phase_runner import PhaseRunner
from mpp_taichi.simulation.recorder import Recorder
from mpp_taichi.simulation.run_length import steps_to
from mpp_taichi.simulation.watched_launches import WatchedLaunches


class RunLoop:
    """Runs a simulation for a while: asks recorders when they are due, takes no more steps than that, and calls the recorders.

    `simulation` is handed to the recorders.
    """

    def __init__(
        self,
        simulation: Any,
        runner: PhaseRunner,
        launches: WatchedLaunches,
        recorders: Sequence[Recorder],
    ) -> None:
        """Bind the parts; nothing runs yet."""
        self._simulation, self._runner, self._launches, self._recorders = simulation, runner, launches, recorders
        self._clock, self._accounts = runner.clock, runner.accounts

    def run(self, span: float, steps: float, end: float, mode: str) -> None:
        """Go on for the time `span`, to the time `end`, or for so many steps where that is less; `mode` as in `RunJudge`.

        Raises:
            StabilityError: the springs do not allow the step, or a number is no longer finite.
        """
        with tidied_after():
            self._go_on(span, steps, end, mode)

    def _go_on(self, span: float, steps: float, end: float, mode: str) -> None:
        self._check_step(span, steps)
        judge = self._simulation.judge
        judge.begin(self._simulation, mode)
        with one_thread.lock:
            if self._accounts.energy_balance is not None:
                self._accounts.energy_balance.look(self._runner)
        self._notify()
        while True:
            ahead = self._runner.time_to_next_phase
            whole, rest, ends_early = self._way(span, steps, end)
            self._step(int(whole), rest)
            if ends_early or span < ahead or ahead == math.inf:
                judge.end(self._simulation)
                return
            steps -= whole + (rest > 0.0)
            judge.end(self._simulation, of_phase=True)
            self._begin_next_phase()
            span = end - self._clock.time  # the difference, so that the last step has the bits of a run that begins here
            self._check_step(span, steps)
            judge.begin(self._simulation, mode)
            self._notify()

    def _way(self, span: float, steps: float, end: float) -> tuple[float, float, bool]:
        """`steps_to`, from the clock's origin on: a run that goes on within a phase ends the phase with the same bits."""
        reading, following = self._clock.save(), self._runner.next_phase_at
        if not reading.steps or math.isinf(min(end, following)):
            return steps_to(span, steps, self._runner.time_to_next_phase, self._clock.dt)
        leg = min(end, following) - reading.origin_time
        whole, rest, ends_early = steps_to(leg, reading.steps + steps, math.inf, self._clock.dt)
        return max(0.0, whole - reading.steps), rest, ends_early

    def _check_step(self, span: float, steps: float) -> None:
        whole, rest, _ = steps_to(span, steps, self._runner.time_to_next_phase, self._clock.dt)
        if whole or rest:
            self._runner.guard.check(self._clock.dt, int(whole) + (rest > 0.0))

    def _step(self, whole: int, rest: float) -> None:
        """So many whole steps, and one of the length `rest` unless that is 0."""
        last = self._clock.step_count + whole
        while self._clock.step_count < last:
            due = min([recorder.steps_until_due(self._simulation) for recorder in self._recorders], default=last)
            most = min(due, last - self._clock.step_count, self._launches.longest(self._runner.phase))
            self._advance(max(1, most), self._clock.dt)
            self._notify()
        if rest > 0.0:
            self._advance(1, rest)
            self._notify()

    def _advance(self, steps: int, dt: float) -> None:
        with one_thread.lock:
            require_life(self._simulation)  # a recorder may have closed the simulation, or started Taichi for itself
            self._launches.advance(self._runner.phase, steps, dt)
            if self._accounts.energy_balance is not None:
                self._accounts.energy_balance.follow(self._runner, steps, dt)

    def _begin_next_phase(self) -> None:
        with one_thread.lock:
            require_life(self._simulation)
            self._runner.begin(self._runner.number + 1)

    def _notify(self) -> None:
        for recorder in self._recorders:
            if recorder.steps_until_due(self._simulation) <= 0:
                recorder.record(self._simulation)
