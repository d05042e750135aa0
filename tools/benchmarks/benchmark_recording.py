"""What frames cost: a recorded run beside its steps alone, its pictures drawn, and its pictures encoded.

    python tools/benchmarks/benchmark_recording.py [--scene scenes/ring.yaml] [--frames 90] [--steps 5] [--repeats 5]
        [--json FILE]

All in one process, in turn, medians, by the clock and, for machines that others use too, by processor time. Steps, drawing and
FFmpeg share the cores of the CPU here; on a GPU the steps do not.
The bar compares a recorded frame with the larger of its steps and its encoding.
"""

import argparse
import os
import sys
import tempfile
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout that is not installed

from verdicts import finish  # noqa: E402

SIZE = (1280, 720)
BAR = 1.1


def measure(arguments):
    """Median milliseconds a frame of each part, and of all together."""
    from mpp_taichi import Simulation
    from mpp_taichi.recorders.film import FilmRecorder
    from mpp_taichi.recorders.video import VideoRecorder
    from mpp_taichi.views._base import Frame
    from mpp_taichi.views.offscreen import open_offscreen

    simulation = Simulation(arguments.scene, backend=arguments.backend, precision=arguments.precision)
    view = open_offscreen(simulation.spec.view, SIZE, dimensions=simulation.spec.dimensions)
    count, steps = arguments.frames, arguments.frames * arguments.steps
    folder = Path(tempfile.mkdtemp())

    def step():
        simulation.run(steps=steps)

    def draw():
        snapshot = simulation.snapshot()
        for k in range(count):
            view.draw(Frame.of(replace(snapshot, time=float(k))))

    def encode():
        with VideoRecorder(folder / "encoded.mp4", SIZE, 30.0) as video:
            for picture in pictures:
                video.write(picture)

    def record():
        with VideoRecorder(folder / "recorded.mp4", SIZE, 30.0) as video:
            film = FilmRecorder(view, [video], count, steps * simulation.dt, stopwatch=lambda _: nullcontext())
            simulation.run(steps=steps, recorders=[film])
            film.finish(simulation)

    pictures = []  # of a run, for the encoder to do the work that it will have to do
    film = FilmRecorder(view, [_Kept(pictures)], count, steps * simulation.dt, stopwatch=lambda _: nullcontext())
    simulation.run(steps=steps, recorders=[film])
    film.finish(simulation)
    parts = {"step": step, "draw": draw, "encode": encode, "record": record}
    seconds, processor = {name: [] for name in parts}, {name: [] for name in parts}
    for _ in range(arguments.repeats):
        for name, part in parts.items():
            began, used = time.perf_counter(), sum(os.times()[:4])  # of this process and of an FFmpeg that has ended
            part()
            seconds[name].append(time.perf_counter() - began)
            processor[name].append(sum(os.times()[:4]) - used)
    taken = {name: np.array(times) / count * 1e3 for name, times in seconds.items()}
    ratio = np.median(taken["record"] / np.maximum(taken["step"], taken["encode"]))
    return {
        "milliseconds_per_frame": {name: float(np.median(times)) for name, times in taken.items()},
        "processor_milliseconds_per_frame": {name: float(np.median(times)) / count * 1e3 for name, times in processor.items()},
        "ratio": float(ratio),
    }


class _Kept:
    """A sink that keeps its pictures."""

    def __init__(self, pictures):
        self.pictures = pictures

    def write(self, picture):
        """Keep one."""
        self.pictures.append(picture.copy())


def main():
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default=str(ROOT / "scenes" / "ring.yaml"))
    parser.add_argument("--backend", default="cpu")
    parser.add_argument("--precision", default="f32")
    parser.add_argument("--frames", type=int, default=90)
    parser.add_argument("--steps", type=int, default=5, help="between two frames")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    found = measure(arguments)
    for name, value in found["milliseconds_per_frame"].items():
        print(f"{name:8s} {value:8.2f} ms a frame, {found['processor_milliseconds_per_frame'][name]:8.2f} ms of processor time")
    bar = "a recorded frame, over the larger of its steps and its encoding, at most"
    verdicts = [(bar, found["ratio"], BAR, found["ratio"] <= BAR)]
    return finish(verdicts, [found], arguments.json, cores=os.cpu_count())


if __name__ == "__main__":
    sys.exit(main())
