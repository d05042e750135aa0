"""Runs a scene in OpenCL: (SceneSpec, Snapshot, steps) → Snapshot."""

from typing import Any

import numpy as np

from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

from .devices import Device, Refused, choose, devices

__all__ = ["Device", "Refused", "Runner", "choose", "devices", "run"]


class Runner:
    """A scene compiled for one device.

    `device` is a Device or what `choose` takes. Raises Refused, in one line, where there is no kernel for the scene, or no device.

    compile_seconds     time that compiling and trying variants took
    device              the Device
    variant             which kernels were chosen, in words
    launches_per_step   kernel launches of one step among many
    """

    def __init__(self, spec: SceneSpec, snapshot: Snapshot, *, device: Device | str | None = None, precision: str = "f64"):
        """Compile, and copy the particles to the device."""
        self.device = device if isinstance(device, Device) else choose(device)
        self.compile_seconds = 0.0
        self.variant = ""
        self.launches_per_step = 0
        raise Refused("there are no kernels yet")

    def advance(self, steps: int) -> float:
        """Advance by so many steps and wait for their end; seconds of the stepping alone."""
        raise NotImplementedError

    def snapshot(self) -> Snapshot:
        """The particles now."""
        raise NotImplementedError

    def accelerations(self) -> np.ndarray:
        """Accelerations of the present state by all forces, (particle_count, 3) float64."""
        raise NotImplementedError

    def close(self) -> None:
        """Give the memory back."""

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
