"""Runs a scene in OpenCL: (SceneSpec, Snapshot, steps) → Snapshot."""

import time
from typing import Any

import numpy as np

from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

from .coverage import problem_of
from .devices import Device, Failed, Refused, choose, devices
from .motion import Motion
from .program import Memory

__all__ = ["Device", "Failed", "Refused", "Runner", "choose", "devices", "run"]

STEPS_TO_COMPILE = 1  # drivers compile a kernel when it is first launched, and a step launches all of them


class Runner:
    """A scene compiled for one device.

    `device` is a Device or what `choose` takes, `variant` the name of a kernel of the direct sum in place of the fastest (see
    n_body.py). The particles begin as in `snapshot`, with its time and step count.

    compile_seconds     time that compiling, trying variants and copying took
    device              the Device
    variant             which kernels were chosen, in words
    launches_per_step   kernel launches of one step among many

    Raises:
        Refused: there is no kernel for something of the scene, or no such device; one line says what is missing.
    """

    def __init__(
        self,
        spec: SceneSpec,
        snapshot: Snapshot,
        *,
        device: Device | str | None = None,
        precision: str = "f64",
        variant: str | None = None,
    ):
        """Compile, and copy the particles to the device."""
        began = time.perf_counter()
        self.device = device if isinstance(device, Device) else choose(device)
        self.problem = problem_of(spec, snapshot, self.device, precision)
        self._memory = Memory(self.device.handle, precision)
        self._motion = Motion(self._memory, self.device, self.problem, snapshot, variant)
        self._motion.advance(STEPS_TO_COMPILE, snapshot.time)
        self.restart(snapshot)
        self.compile_seconds = time.perf_counter() - began

    @property
    def variant(self) -> str:
        """Which kernels were chosen, in words."""
        return self._motion.variant

    @property
    def launches_per_step(self) -> int:
        """Kernel launches of one step among many."""
        return self._motion.launches_per_step

    def restart(self, snapshot: Snapshot) -> None:
        """Go on from other positions and velocities of the same particles."""
        self._start, self._steps = snapshot, 0
        self._motion.write(snapshot)
        self._memory.queue.finish()

    @property
    def time(self) -> float:
        """Simulated time."""
        return self._start.time + self._steps * self.problem.dt

    def advance(self, steps: int) -> float:
        """Advance by so many steps and wait for their end; seconds of the stepping alone.

        Raises:
            Failed: contacts were more than there is room for.
        """
        began = time.perf_counter()
        self._motion.advance(steps, self.time)
        seconds = time.perf_counter() - began
        self._steps += steps
        if self._motion.contacts is not None:
            self._motion.contacts.check()
        return seconds

    def snapshot(self) -> Snapshot:
        """The particles now.

        Raises:
            Failed: a number is not finite.
        """
        position, velocity = self._motion.read()
        bad = np.flatnonzero(~np.isfinite(position).all(axis=1) | ~np.isfinite(velocity).all(axis=1))
        if len(bad):
            raise Failed(f"particle {bad[0]} is not at a finite place after {self._steps} steps, nor {len(bad) - 1} others")
        return self._start.moved(position=position, velocity=velocity, time=self.time, step=self._start.step + self._steps)

    def accelerations(self) -> np.ndarray:
        """Accelerations of the present state by all forces, (particle_count, 3) float64."""
        return self._motion.accelerations()

    def close(self) -> None:
        """Give the memory back."""
        self._memory.release()

    def __enter__(self) -> "Runner":
        """Use as a context manager."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close at the end of the block."""
        self.close()


def run(spec: SceneSpec, snapshot: Snapshot, steps: int, **options: Any) -> Snapshot:
    """The particles after so many steps; `options` are those of Runner."""
    with Runner(spec, snapshot, **options) as runner:
        runner.advance(steps)
        return runner.snapshot()
