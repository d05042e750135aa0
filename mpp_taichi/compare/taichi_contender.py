"""Taichi contender: a Simulation on one of Taichi's backends."""

import time as clock
from dataclasses import replace
from typing import Any

import numpy as np

from mpp_taichi.device.backends import import_taichi
from mpp_taichi.errors import BackendError
from mpp_taichi.scene.asked_quantities import without_tangent
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.snapshot import Snapshot

COPIES = 5  # of which the median is told


class TaichiContender:
    """A scene without its timeline on a backend and in a precision."""

    def __init__(
        self, spec: SceneSpec, start: Snapshot, backend: str, precision: str, *, threads: int | None = None, plan: str = "auto"
    ) -> None:
        """Start the backend, and compile the scene by taking one step.

        Raises:
            BackendError: the backend does not start here, or cannot run this scene.
        """
        self.simulation = Simulation(
            without_tangent(replace(spec, timeline=(), accuracy=None)),
            backend=backend,
            precision=precision,
            plan=plan,
            threads=threads if backend == "cpu" else None,
            start=start,
            force=True,
        )
        began = clock.perf_counter()
        sound = self.simulation.try_steps(1)
        first = clock.perf_counter() - began
        if not sound:
            raise BackendError(f"the first step on {backend} in {precision} gives a number that is not finite")
        again = self.advance(1)
        device = self.simulation.device
        self.facts: dict[str, Any] = {
            "device": device.name,
            "on_cpu": device.on_cpu,
            "threads": device.threads or None,
            "plan": self.simulation.plan,
            "evaluations": self.simulation.integrator.evaluations_per_step,
            "launches_per_step": self.simulation.launcher.launches_per_step(),
            "setup_seconds": self.simulation.timings.setup_seconds,
            "compile_seconds": max(0.0, first - again),
        }
        self._forces: Any = None
        self.restart()

    def accelerations_at(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `Contender`; by the loops that the simulation's own plan runs."""
        from mpp_taichi.compare.felt_forces import FeltForces  # imports Taichi, which has to be started

        simulation = self.simulation
        self.begin(position, velocity)
        if self._forces is None:
            self._forces = FeltForces(simulation.state, simulation.total_force, simulation.launcher.force_sum)
        acceleration = np.zeros_like(position)
        acceleration[:, : simulation.spec.dimensions] = self._forces.measure(simulation.time)
        place, speed = simulation.state.read()
        return place, speed, acceleration

    def restart(self) -> None:
        """See `Contender`."""
        self.simulation.restart()

    def begin(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """See `Contender`."""
        self.simulation.restart()
        self.simulation.state.write(position, velocity)

    def advance(self, steps: int) -> float:
        """See `Contender`; numbers that are not finite raise no error here."""
        began = clock.perf_counter()
        self.simulation.try_steps(steps)  # waits for the device
        return clock.perf_counter() - began

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """See `Contender`."""
        return self.simulation.state.read()

    def copy_seconds(self) -> float:
        """See `Contender`."""
        position: Any = getattr(self.simulation.state, "position")  # noqa: B009 — a field, there by its name
        import_taichi().sync()
        seen = []
        for _ in range(COPIES):
            began = clock.perf_counter()
            position.to_numpy()
            seen.append(clock.perf_counter() - began)
        return float(np.median(seen))

    def peaks(self) -> dict[str, float]:
        """See `Contender`."""
        from mpp_taichi.compare.taichi_peaks import taichi_peaks

        return taichi_peaks(self.simulation.device)

    def close(self) -> None:
        """See `Contender`."""
        self.simulation.close()
