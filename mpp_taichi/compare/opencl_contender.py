"""Opencl contender: the kernels of the folder `opencl/` beside the package, on the device that its runner chooses."""

import time as clock
from typing import Any

import numpy as np

from mpp_taichi.compare.opencl_package import load_opencl
from mpp_taichi.errors import BackendError
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

COPIES = 5  # of which the median is told


def runner_module() -> Any:
    """The runner of `opencl/`.

    Raises:
        BackendError: the runner does not exist here.
    """
    try:
        return load_opencl()
    except ModuleNotFoundError as error:
        raise BackendError(str(error)) from None


class OpenclContender:
    """The OpenCL runner as a backend."""

    def __init__(self, spec: SceneSpec, start: Snapshot, precision: str, *, variant: str | None = None) -> None:
        """Compile the scene; `variant` is a variant of the runner's kernels.

        Raises:
            BackendError: no OpenCL device exists, or no kernels for this scene.
        """
        self._module, self._spec, self._start, self._precision = runner_module(), spec, start, precision
        began = clock.perf_counter()
        self._runner = self._run(variant)
        device = self._runner.device
        self.facts: dict[str, Any] = {
            "device": device.id,
            "on_cpu": device.type == "cpu",
            "plan": self._runner.variant,
            "launches_per_step": self._runner.launches_per_step,
            "setup_seconds": clock.perf_counter() - began - self._runner.compile_seconds,
            "compile_seconds": self._runner.compile_seconds,
        }
        self.restart()

    def _run(self, variant: str | None) -> Any:
        try:
            return self._module.Runner(self._spec, self._start, precision=self._precision, variant=variant)
        except self._module.Refused as refused:
            raise BackendError(str(refused)) from None

    def accelerations_at(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `Contender`."""
        self.begin(position, velocity)
        place, speed = self.read()
        return place, speed, self._runner.accelerations()

    def restart(self) -> None:
        """See `Contender`."""
        self._runner.restart(self._start)

    def begin(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """See `Contender`."""
        start = self._start
        self._runner.restart(start.moved(position=position, velocity=velocity, time=start.time, step=start.step))

    def advance(self, steps: int) -> float:
        """See `Contender`."""
        return float(self._runner.advance(steps))

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """See `Contender`; NaN for all numbers where one is not finite, since the runner shows none of them."""
        try:
            now = self._runner.snapshot()
        except self._module.Failed:
            return np.full((2, *self._start.position.shape), np.nan)  # type: ignore[return-value]
        return now.position, now.velocity

    def copy_seconds(self) -> float:
        """See `Contender`, including the velocities, which the runner copies too."""
        seen = []
        for _ in range(COPIES):
            began = clock.perf_counter()
            self._runner.snapshot()
            seen.append(clock.perf_counter() - began)
        return float(np.median(seen))

    def peaks(self) -> dict[str, float]:
        """See `Contender`."""
        from mpp_taichi.compare.opencl_peaks import opencl_peaks

        device = self._runner.device
        return opencl_peaks(device.handle, self._precision, on_gpu=device.type != "cpu")

    def close(self) -> None:
        """See `Contender`."""
        self._runner.close()
