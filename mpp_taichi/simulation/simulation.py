"""Simulation: time, step count, the order of operations, and the execution plan."""

import math
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from mpp_taichi.device import backends
from mpp_taichi.device.thread_count import check_threads
from mpp_taichi.errors import MppError, SceneError
from mpp_taichi.scene.estimate import check_capacity, estimate
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.timeline import whole_steps
from mpp_taichi.simulation.phased_motion import PhasedMotion
from mpp_taichi.simulation.phases import Course, phase_at, phases_of
from mpp_taichi.simulation.shown import Shown
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.step import plans
from mpp_taichi.walls._base import Surface

if TYPE_CHECKING:
    from mpp_taichi.energy.energy_balance import EnergyBalance

GPU_WORTH_WORK = 4_000_000  # work per step (see plans) from which `auto` looks for a GPU


class Recorder(Protocol):
    """Something that wants to see the simulation now and then."""

    def steps_until_due(self, simulation: "Simulation") -> int:
        """How many steps may pass before the next look; 0 means now."""

    def record(self, simulation: "Simulation") -> None:
        """Look."""


class Simulation(PhasedMotion, Shown):
    """A scene, compiled to one step and run on one device; with a timeline, to one step for each phase.

    What depends on the phase (`spec`, `dt`, `integrator`, `total_force`, `state`, …) is that of the present one, `phase_number`
    in `phases`; `scene` is the whole, with its timeline and all that was set.

    `scene` is a path, a mapping of the shape of the YAML, or a SceneSpec; `overrides` are those of `--set`. `replica_starts`
    holds the starting snapshots of independent copies of the scene that run side by side, one thread each. `start` is a state
    of the same particles to go on from instead of the scene's own, with its time and step count. `force` runs a step that is
    beyond what the springs allow, `event_log` lets event-driven contacts note every collision. Raises SceneError,
    ArgumentError, BackendError or CapacityError before anything is allocated, StabilityError when it is run.
    """

    def __init__(
        self,
        scene: str | Path | Mapping[str, Any] | SceneSpec,
        *,
        backend: str = "auto",
        precision: str | None = None,
        plan: str = "auto",
        overrides: Mapping[str, Any] | Sequence[str] = (),
        replica_starts: Sequence[Snapshot] = (),
        threads: int | None = None,
        start: Snapshot | None = None,
        force: bool = False,
        event_log: bool = False,
    ):
        """Read the scene, start the backend, allocate and fill the fields; kernels are compiled at the first step."""
        began = clock.perf_counter()
        check_threads(threads)
        read = load_scene(scene, overrides=overrides)
        if read.accuracy is not None:
            raise SceneError(
                f"{read.source}: accuracy: what reaches it is still to be chosen, by mpp_taichi.settle or the run verb"
            )
        self.estimate = estimate(read)
        check_capacity(self.estimate)
        phases = phases_of(read)
        first = phase_at(phases, 0.0 if start is None else start.time)
        made = phases[first].particles
        course = Course(read, phases, first, made if start is None else start.continuing(made))
        work = max(plans.step_work(each.spec, each.particles.particle_count, len(each.particles.springs)) for each in phases)
        large = work >= GPU_WORTH_WORK and all(phase.spec.contacts is None for phase in phases)  # no GPU has run them yet
        device = backends.start(backend, precision, large=large, threads=threads)
        super().__init__(course, device, plan=plan, replica_starts=replica_starts, force=force, event_log=event_log)
        self.setup_seconds = clock.perf_counter() - began

    # --- time -----------------------------------------------------------------------------------------------------------

    def run(
        self,
        duration: float | None = None,
        *,
        until: float | None = None,
        steps: int | None = None,
        recorders: Sequence[Recorder] = (),
    ) -> "Simulation":
        """Advance by `duration`, `until` a time, or by `steps`; without any of them as the scene's `run:` says.

        A loop of: ask the recorders when they are due, step that far at most, check that every number is finite, let the
        recorders look. If the end is no whole number of steps away, one shorter step reaches it exactly. The end of a phase is
        reached in the same way, and the next one begins there and then. A step beyond what the springs allow is refused with
        a StabilityError, see `check_step`.
        """
        self._require_life()
        span, left = self._plan_run(duration, until, steps)
        end = self.time + span if until is None else float(until)
        self._check_leg(span, left)
        if self.energy_balance is not None:
            self.energy_balance.look(self)
        self._notify(recorders)
        while True:
            ahead = self.time_to_next_phase
            whole, rest, ends_early = self._leg(span, left)
            self._step(int(whole), rest, recorders)
            if ends_early or span < ahead or ahead == math.inf:
                return self
            left -= whole + (rest > 0.0)
            self._begin_phase(self.phase_number + 1)
            span = end - self.time  # not what is left of the span: the last step has then the bits that it has by itself
            self._check_leg(span, left)
            self._notify(recorders)

    def look_at_multiples_of(self, interval: float) -> None:
        """Where contacts fly and a step is a mere look: let looks fall on multiples of `interval`, no rarer than so far."""
        if not self.launcher.takes_steps:
            self.dt = interval / math.ceil(interval / self.dt)

    def _leg(self, span: float, left: float) -> tuple[float, float, bool]:
        """Whole steps to the end of the phase or the run, the length of a last, shorter one, and whether `left` comes first."""
        leg = min(span, self.time_to_next_phase)
        whole, rest = whole_steps(leg, self.dt) if leg < math.inf else (left, 0.0)
        return (left, 0.0, True) if left < whole + (rest > 0.0) else (whole, rest, False)

    def _check_leg(self, span: float, left: float) -> None:
        whole, rest, _ = self._leg(span, left)
        if whole or rest:
            self.check_step(int(whole) + (rest > 0.0))

    def _step(self, whole: int, rest: float, recorders: Sequence[Recorder]) -> None:
        """So many steps, and one of the length `rest` unless that is 0."""
        last = self.step_count + whole
        while self.step_count < last:
            due = min([recorder.steps_until_due(self) for recorder in recorders], default=last)
            self._advance(max(1, min(due, last - self.step_count, self._longest_launch())), self.dt)
            self._notify(recorders)
        if rest > 0.0:
            self._advance(1, rest)
            self._notify(recorders)

    def _plan_run(self, duration: float | None, until: float | None, steps: int | None) -> tuple[float, float]:
        """How much time and how many steps a run may take; one of them is infinite."""
        if sum(argument is not None for argument in (duration, until, steps)) > 1:
            raise MppError("run takes one of duration, until and steps")
        if duration is None and until is None and steps is None:
            duration, steps = self.spec.run.duration, self.spec.run.steps
            if duration is None and steps is None:
                raise MppError("the scene has no run.duration, so say how long: duration, until or steps")
        if steps is not None:
            if steps < 0:
                raise MppError(f"steps must not be negative, got {steps}")
            return math.inf, steps
        span = float(duration) if duration is not None else float(until or 0.0) - self.time
        if not math.isfinite(span) or span < 0.0:
            raise MppError(f"cannot run for a time of {span}")
        return span, math.inf

    def _notify(self, recorders: Sequence[Recorder]) -> None:
        for recorder in recorders:
            if recorder.steps_until_due(self) <= 0:
                recorder.record(self)

    # --- looking --------------------------------------------------------------------------------------------------------

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The walls' surfaces of the present phase, in the order of ContactReport.wall_impulse."""
        return () if self.contacts is None else self.contacts.setup.enclosure.surfaces

    def diagnostics(self) -> dict[str, Any]:
        """Energies, momentum, angular momentum and centre of mass now; see `energy.mechanics`.

        With an energy balance also dissipated_energy, work, energy_balance_residual and energy_turnover.
        """
        found = self.mechanics()
        if self.energy_balance is not None:
            found |= self.energy_balance.account(self, found["total_energy"])
        return found

    def keep_energy_balance(self) -> "EnergyBalance":
        """From now on keep account of dissipated energy and work, step by step."""
        from mpp_taichi.energy.energy_balance import EnergyBalance

        self._require_life()
        self.energy_balance = EnergyBalance(self._power_meter())
        return self.energy_balance

    def checkpoint(self, path: str | Path) -> None:
        """Write the state now to a `.npz` file, from which `start` or --rewind goes on; OutputError where that fails."""
        replace(self.snapshot(), dt=self.dt).save(path)

    # --- end ------------------------------------------------------------------------------------------------------------

    def __enter__(self) -> "Simulation":
        """Use as a context manager."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close at the end of the block."""
        self.close()
