"""Numpy contender: the reference's own forces and steps as a backend, in f64."""

import time as clock
from typing import Any

import numpy as np

from mpp_taichi.compare import numpy_reference, numpy_steps
from mpp_taichi.compare.numpy_reference import NumpyForces, bodies, kept, pair_forces
from mpp_taichi.compare.numpy_steps import NumpySteps
from mpp_taichi.compare.peaks import numpy_peaks
from mpp_taichi.errors import BackendError
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

MOST_PAIRS = 1e9  # of a step: some ten seconds, and arrays larger than any cache


class NumpyContender:
    """The NumPy reference as a backend, in one thread."""

    def __init__(self, spec: SceneSpec, start: Snapshot, precision: str) -> None:
        """Bind the scene.

        Raises:
            BackendError: the NumPy reference lacks an effect of this scene, or this precision.
        """
        refused = numpy_reference.refusal(spec) or numpy_steps.refusal(spec)
        if refused is None and precision != "f64":
            refused = "the NumPy backend computes only in f64"
        if refused is None and pair_forces(spec) * start.particle_count**2 > MOST_PAIRS:
            refused = f"NumPy takes too long for so many pairs; it goes up to {round(MOST_PAIRS**0.5):,} particles"
        if refused:
            raise BackendError(refused)
        self._start, self._precision = start, precision
        self._reference = NumpyForces(spec, bodies(start, spec.dimensions, [precision]))
        dt = float(spec.integrator.parameters["dt"])
        self._steps = NumpySteps(self._reference, spec.integrator.name, np.array([dt]))
        self.restart()
        self.facts: dict[str, Any] = {
            "device": f"NumPy {np.__version__}",
            "on_cpu": True,
            "plan": "arrays",
            "launches_per_step": None,
            "setup_seconds": 0.0,
            "compile_seconds": 0.0,
        }

    def accelerations_at(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `Contender`."""
        place, speed = kept(position, self._precision), kept(velocity, self._precision)
        return place, speed, self._reference.acceleration(place[None], speed[None])[0]

    def restart(self) -> None:
        """See `Contender`."""
        self.begin(self._start.position, self._start.velocity)

    def begin(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """See `Contender`."""
        place, speed = (kept(values, self._precision) for values in (position, velocity))
        self._steps.start(place[None], speed[None])

    def advance(self, steps: int) -> float:
        """See `Contender`."""
        began = clock.perf_counter()
        self._steps.advance(steps)
        return clock.perf_counter() - began

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """See `Contender`."""
        return self._steps.position[0].copy(), self._steps.velocity[0].copy()

    def copy_seconds(self) -> float:
        """Nothing has to be copied."""
        return 0.0

    def peaks(self) -> dict[str, float]:
        """See `Contender`."""
        return numpy_peaks()

    def close(self) -> None:
        """Do nothing: no device is held."""
