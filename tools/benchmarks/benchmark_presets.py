"""What the presets of x264 cost, and how close their films are to the frames: processor time, size and SSIM.

    python tools/benchmarks/benchmark_presets.py [scenes/ring.yaml …] [--presets ultrafast … medium] [--crf 18 …] [--frames 120]
        [--repeats 3] [--json FILE]

The first frames of the film of each scene are drawn once and kept as raw pixels. Then each preset encodes them by the command
of the program, in turn; processor times are those of the encoder as a process, and with them the conversion of the colours.
SSIM is FFmpeg's, between the film and the frames in the colours in which the encoder takes them (4:2:0, BT.709): the mean of
all frames and the worst frame. `--crf` gives other qualities of x264 beside the program's own, so that two presets can be
compared at equal SSIM. Nothing is a bar: a preset is a choice.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from contextlib import nullcontext
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout that is not installed

SIZE = (1280, 720)
FPS = 30.0
PRESETS = ("ultrafast", "superfast", "veryfast", "faster", "fast", "medium")


def draw(scene, frames, file):
    """The first frames of the film of a scene, as raw pixels in a file."""
    from mpp_taichi import Simulation
    from mpp_taichi.recorders.film import FilmRecorder
    from mpp_taichi.views.offscreen import open_offscreen

    simulation = Simulation(scene, backend="cpu", precision="f32")
    view = open_offscreen(simulation.spec.view, SIZE, dimensions=simulation.spec.dimensions)
    run, whole = simulation.spec.run, FPS * simulation.spec.record.seconds
    steps = max(round((run.steps or run.duration / simulation.dt) * min(frames / whole, 1)), 1)
    with file.open("wb") as raw:
        film = FilmRecorder(view, [_Raw(raw)], frames, steps * simulation.dt, stopwatch=lambda _: nullcontext())
        simulation.run(steps=steps, recorders=[film])
        film.finish(simulation)


class _Raw:
    """A sink that writes pixels."""

    def __init__(self, file):
        self.file = file

    def write(self, picture):
        """One frame."""
        self.file.write(np.ascontiguousarray(picture).data)


def command(executable, film, preset, crf):
    """The program's own command with another preset and quality; None keeps its own."""
    from mpp_taichi.recorders.video import encoder_command

    words = encoder_command(executable, film, SIZE, FPS)
    for option, value in (("-preset", preset), ("-crf", crf)):
        if value is not None:
            words[words.index(option) + 1] = str(value)
    return words


def encode(executable, raw, film, preset, crf):
    """Seconds of processor time and of the clock."""
    with raw.open("rb") as pixels:
        before, began = os.times(), time.perf_counter()
        subprocess.run(command(executable, film, preset, crf), stdin=pixels, check=True)
        after = os.times()
    processor = after.children_user + after.children_system - before.children_user - before.children_system
    return processor, time.perf_counter() - began


def likeness(executable, raw, film):
    """SSIM of all frames and of the worst, and of brightness alone."""
    stats = film.with_suffix(".txt")
    taken = "[1:v]scale=out_color_matrix=bt709:out_range=tv,format=yuv420p[frames];[0:v][frames]ssim=stats_file=" + str(stats)
    size = f"{SIZE[0]}x{SIZE[1]}"
    pixels = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", size, "-framerate", repr(FPS), "-i", str(raw)]
    told = subprocess.run(
        [executable, "-hide_banner", "-nostdin", "-i", str(film), *pixels, "-lavfi", taken, "-f", "null", "-"],
        check=True, stderr=subprocess.PIPE, text=True,
    ).stderr  # fmt: skip
    mean = re.search(r"SSIM Y:([\d.]+).*All:([\d.]+)", told)
    each = [float(found) for found in re.findall(r"All:([\d.]+)", stats.read_text(encoding="utf-8"))]
    return {"ssim": float(mean[2]), "ssim_of_brightness": float(mean[1]), "ssim_of_the_worst_frame": min(each)}


def measure(executable, scene, arguments, folder):
    """Rows of one scene."""
    raw = folder / "frames.raw"
    draw(scene, arguments.frames, raw)
    count = raw.stat().st_size // (SIZE[0] * SIZE[1] * 3)
    cases = {(preset, crf): ([], []) for preset in arguments.presets for crf in arguments.crf}
    for _ in range(arguments.repeats):
        for (preset, crf), times in cases.items():
            for kept, taken in zip(times, encode(executable, raw, folder / f"{preset}-{crf}.mp4", preset, crf)):
                kept.append(taken / count * 1e3)
    rows = []
    print(f"\n{scene}, {count} frames of {SIZE[0]} × {SIZE[1]}")
    print(f"{'preset':10}{'crf':>6}{'processor':>12}{'clock':>12}{'size':>14}{'SSIM':>10}{'brightness':>12}{'worst':>10}")
    for (preset, crf), (processor, clock) in cases.items():
        film = folder / f"{preset}-{crf}.mp4"
        row = {"scene": scene, "preset": preset, "crf": crf}
        row |= {"milliseconds": float(np.median(processor)), "clock": float(np.median(clock))}
        row |= {"bytes_per_frame": film.stat().st_size / count, **likeness(executable, raw, film)}
        rows.append(row)
        told = f"{preset:10}{crf or 'own':>6}{row['milliseconds']:9.2f} ms{row['clock']:9.2f} ms"
        told += f"{row['bytes_per_frame'] / 1e3:11.2f} kB{row['ssim']:10.5f}"
        print(f"{told}{row['ssim_of_brightness']:12.5f}{row['ssim_of_the_worst_frame']:10.5f}", flush=True)
    return rows


def main():
    """Draw, encode, compare, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=[str(ROOT / "scenes" / "ring.yaml")])
    parser.add_argument("--presets", nargs="+", default=PRESETS)
    parser.add_argument("--crf", nargs="+", type=float, default=[None], help="of x264; the program's own when absent")
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    from mpp_taichi.recorders.video import check_encoder

    executable, rows = check_encoder(), []
    with tempfile.TemporaryDirectory() as folder:
        for scene in arguments.scenes:
            rows += measure(executable, scene, arguments, Path(folder))
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
