"""Worker: one backend with one scene in a process of its own, controlled by lines of JSON.

Run as `python -m mpp_taichi.compare.worker`. Each line on standard input is `{"do": name, …}`; the answer is a line on
standard output, `{"ok": true, …}` or `{"ok": false, "reason": …}`. Arrays go by `.npz` files that the line names. The
output of libraries goes to standard error.
"""

import contextlib
import os
import time as clock
from typing import Any

import numpy as np

from mpp_taichi.compare.answering import answer_lines
from mpp_taichi.compare.evidence import Contender, follow, gather
from mpp_taichi.device.energy_counters import EnergyMeasurement, energy_counters
from mpp_taichi.errors import MppError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

SAMPLE_SECONDS = 0.05  # the least length of a timing, far above the resolution of the clock
MOST_STEPS = 1 << 20


def contender(
    spec: SceneSpec, start: Snapshot, backend: str, precision: str, threads: int | None, variant: str = ""
) -> Contender:
    """The scene on a backend; `variant` is an execution plan of this program, or a kernel of the OpenCL runner."""
    if backend == "numpy":
        from mpp_taichi.compare.numpy_contender import NumpyContender

        return NumpyContender(spec, start, precision)
    if backend == "opencl":
        from mpp_taichi.compare.opencl_contender import OpenclContender

        return OpenclContender(spec, start, precision, variant=variant or None)
    from mpp_taichi.compare.taichi_contender import TaichiContender

    return TaichiContender(spec, start, backend, precision, threads=threads, plan=variant or "auto")


class Worker:
    """Answers requests."""

    def __init__(self) -> None:
        """Begin without a backend."""
        self._contender: Contender | None = None
        self._counters = energy_counters()
        self._steps = 1

    def answer(self, line: dict[str, Any]) -> dict[str, Any]:
        """Carry out a request."""
        return getattr(self, f"do_{line.pop('do')}")(**line)

    def do_build(
        self, scene: dict, folder: str, start: str | None, backend: str, precision: str, threads: int | None, variant: str = ""
    ) -> dict[str, Any]:
        """Load the scene and build it on the backend, replacing the last one; without `start`, from the scene's own start."""
        from mpp_taichi.start.assemble import assemble

        self.do_close()
        os.chdir(folder)  # the folder of the files that the scene names
        spec = load_scene(scene)
        begin = Snapshot.load(start) if start else assemble(spec)
        self._contender = contender(spec, begin, backend, precision, threads, variant)
        self._steps = 1
        return {"facts": self._contender.facts}

    def do_gather(self, states: str, looks: list[int], forces: bool, to: str) -> dict[str, Any]:
        """Write the evidence to a file."""
        with np.load(states, allow_pickle=False) as given:
            pairs = list(zip(given["position"], given["velocity"], strict=True))
        found = gather(self._ready, pairs, looks, forces=forces)
        np.savez(to, **vars(found))
        return {}

    def do_follow(self, starts: str, looks: list[int], to: str) -> dict[str, Any]:
        """Write runs from other starts to a file."""
        with np.load(starts, allow_pickle=False) as given:
            pairs = list(zip(given["position"], given["velocity"], strict=True))
        places, speeds = follow(self._ready, pairs, looks)
        np.savez(to, places=places, speeds=speeds)
        return {}

    def do_calibrate(self, seconds: float) -> dict[str, Any]:
        """Find the number of steps that take SAMPLE_SECONDS, within a limit of seconds."""
        began, steps = clock.perf_counter(), 1
        self._time(1)
        while (taken := self._time(steps)) < SAMPLE_SECONDS and steps < MOST_STEPS:
            if clock.perf_counter() - began > seconds:
                break
            steps *= max(2, min(16, int(1.2 * SAMPLE_SECONDS / max(taken, 1e-6))))
        self._steps = steps
        return {"steps": steps, "seconds_per_step": taken / steps}

    def do_time(self) -> dict[str, Any]:
        """Time the steps found by `do_calibrate`, from the start; returns the seconds of a step, and its energy if known."""
        measurement = EnergyMeasurement(self._counters)
        seconds, joules = self._time(self._steps), measurement.joules()
        return {"seconds_per_step": seconds / self._steps, "joules_per_step": None if joules is None else joules / self._steps}

    def do_copy(self) -> dict[str, Any]:
        """The seconds for copying positions to the host."""
        return {"seconds": self._ready.copy_seconds()}

    def do_peaks(self) -> dict[str, Any]:
        """The highest rates of the device."""
        return self._ready.peaks()

    def do_close(self) -> dict[str, Any]:
        """Free the device."""
        if self._contender is not None:
            self._contender.close()
        self._contender = None
        return {}

    @property
    def _ready(self) -> Contender:
        if self._contender is None:
            raise MppError("no scene was built")
        return self._contender

    def _time(self, steps: int) -> float:
        self._ready.restart()
        return self._ready.advance(steps)


def main() -> None:
    """Answer until standard input ends."""
    worker = Worker()
    answer_lines(worker.answer)
    with contextlib.suppress(Exception):
        worker.do_close()


if __name__ == "__main__":
    main()
