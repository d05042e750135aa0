"""What keeping a film in the archive of its run costs: films with and without an archive, in turn.

    python tools/benchmarks/benchmark_kept_film.py [--scenes ring solar_system …] [--frames 60] [--repeats 5] [--json FILE]

All in one process: the first part of the film of each scene, 1280 x 720, through the encoder. `keep` is the processor time of
finding the changes of one picture, and `write` of packing and writing it. Both times of the film are medians; the ratio is the
median over pairs of films that were made one after the other.
"""

import argparse
import os
import sys
import tempfile
import time
from contextlib import nullcontext
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout that is not installed

from verdicts import finish  # noqa: E402

SCENES = ("ring", "solar_system", "maxwell_boltzmann", "cloth")
SIZE = (1280, 720)
BAR = 1.03


def measure(name, arguments, folder):
    """One row of the table."""
    from mpp_taichi import Simulation
    from mpp_taichi.recorders.film import FilmRecorder
    from mpp_taichi.recorders.kept_pictures import KeptPictures
    from mpp_taichi.recorders.video import VideoRecorder
    from mpp_taichi.simulation.run_archive import RunArchive, header_of
    from mpp_taichi.views.offscreen import open_offscreen

    simulation = Simulation(ROOT / "scenes" / f"{name}.yaml", backend="cpu")
    spec = simulation.spec
    view = open_offscreen(spec.view, SIZE, dimensions=spec.dimensions)
    run, count = spec.run, arguments.frames
    span = run.duration if run.duration is not None else run.steps * simulation.dt
    part = span * count / round(spec.record.fps * spec.record.seconds)
    found = {}

    def film(*, kept):
        simulation.restart()
        began, used = time.perf_counter(), time.process_time()
        with VideoRecorder(folder / "film.mp4", SIZE, 30.0) as video:
            sink = KeptPictures(video) if kept else video
            recorder = FilmRecorder(view, [sink], count, part, stopwatch=lambda _: nullcontext())
            recorders = [recorder]
            if kept:
                sink.begin_anew()
                archive = RunArchive(folder / "film.run", header_of(simulation), {}, outputs={"film": sink})
                recorders.append(archive)
            simulation.run(duration=part, recorders=recorders)
            recorder.finish(simulation)
            if kept:
                archive.record(simulation)
                found["bytes"] = archive._output_bytes / count
                archive.end()
        return time.perf_counter() - began, time.process_time() - used

    film(kept=False)
    pairs = []
    for turn in range(arguments.repeats):
        order = (False, True) if turn % 2 else (True, False)
        seconds = {kept: film(kept=kept) for kept in order}
        pairs.append([*seconds[False], *seconds[True]])
    plain, plain_used, kept, kept_used = np.median(pairs, axis=0) / count * 1e3
    ratios = np.array(pairs)[:, 2] / np.array(pairs)[:, 0]
    return {
        "scene": name,
        "bytes_per_picture": found["bytes"],
        "film_ms_per_picture": plain,
        "kept_film_ms_per_picture": kept,
        "more_processor_ms_per_picture": kept_used - plain_used,
        "ratio": float(np.median(ratios)),
    }


def main():
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--frames", type=int, default=90)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rows = []
    print("scene                kB a picture   film, ms a picture   with archive   ratio   processor, ms a picture more")
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.scenes:
            row = measure(name, arguments, Path(folder))
            rows.append(row)
            times = f"{row['film_ms_per_picture']:18.1f} {row['kept_film_ms_per_picture']:14.1f} {row['ratio']:8.3f}"
            more = f"{row['more_processor_ms_per_picture']:12.2f}"
            print(f"{name:20s} {row['bytes_per_picture'] / 1e3:12.0f} {times} {more}", flush=True)
    worst = max(row["ratio"] for row in rows)
    return finish(
        [("a film that is kept, over one that is not, at most", worst, BAR, worst <= BAR)],
        rows,
        arguments.json,
        cores=os.cpu_count(),
    )


if __name__ == "__main__":
    sys.exit(main())
