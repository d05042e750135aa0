"""`accuracy: 1e-k` chosen beside busy processes: is the choice the same, or as good, as the choice on a quiet machine?

    python tools/benchmarks/benchmark_busy_choices.py [--scenes kepler,membrane] [--digits 3,6,9] [--busy 20] [--pilot 20]
        [--json FILE]

Every scene is chosen for twice, each time without an earlier choice: with nothing else running, and beside so many processes
that compute without end. Afterwards, on the quiet machine, both choices are timed in turns, and the error of the busy choice is
measured against the reference of benchmark_targets.py:

    ratio   shortest time of the busy choice over the shortest time of the quiet choice
    error   of the busy choice, over the size of the system
    cpu s   seconds of processor time that the choice took beside the busy processes
"""

import argparse
import contextlib
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]  # so that it also runs from a checkout

from benchmark_targets import BUNDLED, OWN, SCENES, delivered, timed  # noqa: E402
from long_double_reference import reference_end  # noqa: E402

from mpp_taichi.accuracy.budget import Budget  # noqa: E402
from mpp_taichi.accuracy.choice import choose  # noqa: E402
from mpp_taichi.accuracy.methods import LOOKS  # noqa: E402
from mpp_taichi.accuracy.problem import pose  # noqa: E402
from mpp_taichi.accuracy.reference import size_of  # noqa: E402
from mpp_taichi.accuracy.sample import Configuration  # noqa: E402
from mpp_taichi.accuracy.workbench import Workbench  # noqa: E402
from mpp_taichi.errors import StabilityError  # noqa: E402
from mpp_taichi.scene.load import load_scene  # noqa: E402


@contextlib.contextmanager
def busy(count):
    """A block beside so many processes that compute without end."""
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def chosen(spec, span, folder, pilot):
    """The choice, its configuration, or the reason of a refusal; and the seconds of processor time that it took."""
    began = time.process_time()
    try:
        found = choose(spec, folder, seconds=pilot)
    except StabilityError as error:
        return None, str(error).split(": ", 2)[-1], time.process_time() - began
    steps = LOOKS if found.tolerance is not None else round(span / found.dt)
    made = Configuration(found.integrator, steps, found.precision, "cpu", found.control, found.tolerance)
    return found, made, time.process_time() - began


def size_of_run(problem, configuration):
    """Root mean square distance of the moving particles from their common mean place, over a run that reaches its target."""
    with Workbench(problem, backend="cpu", precision=configuration.precision) as bench:
        _, trace = bench.machine(configuration.integrator).run(configuration, Budget(600.0), follow=True)
    return size_of(trace)


def measure(name, digits, count, pilot, folder):
    """Rows of one scene."""
    changes = SCENES[name]
    path = next(path for folder in (OWN, BUNDLED) if (path := folder / f"{name}.yaml").is_file())
    plain = load_scene(path, overrides=changes)
    problem = pose(plain)
    end = reference_end(plain, problem.start, problem.span)
    rows, pairs = [], []
    for k in digits:
        spec = load_scene(path, overrides={**changes, "accuracy": 10.0**-k})
        _, quiet, _ = chosen(spec, problem.span, folder / f"quiet-{k}", pilot)
        with busy(count):
            found, loaded, seconds = chosen(spec, problem.span, folder / f"busy-{k}", pilot)
        both = isinstance(quiet, Configuration) and isinstance(loaded, Configuration)
        pairs.append((quiet, loaded) if both else None)
        row = {"scene": name, "target": 10.0**-k, "pilot_seconds": seconds}
        row |= {"quiet": getattr(quiet, "key", quiet), "busy": getattr(loaded, "key", loaded)}
        row["error"] = None if found is None else delivered(spec, found, end, size_of_run(problem, loaded))
        rows.append(row)
    seconds = timed(problem, list(dict.fromkeys(each for pair in pairs if pair for each in pair)))
    for row, pair in zip(rows, pairs):
        row["ratio"] = seconds[pair[1].key] / seconds[pair[0].key] if pair else 1.0 if row["quiet"] == row["busy"] else math.inf
        error = "refused" if row["error"] is None else f"{row['error']:.1e}"
        told = f"{row['scene']:<20} {row['target']:<8.0e} {row['ratio']:<6.2f} {error:<8} {row['pilot_seconds']:<6.1f}"
        print(f"{told} {row['quiet'][:40]:<40} {row['busy'][:40]}", flush=True)
    return rows


def main():
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default="kepler,figure_eight,membrane,cluster,sun_earth,driven_oscillator")
    parser.add_argument("--digits", default="3,6,9")
    parser.add_argument("--busy", type=int, default=20, help="number of busy processes")
    parser.add_argument("--pilot", type=float, default=20.0, help="seconds of processor time of each choice")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    print(f"{os.cpu_count()} processors, {arguments.busy} busy processes")
    print(f"{'scene':<20} {'target':<8} {'ratio':<6} {'error':<8} {'cpu s':<6} {'quiet choice':<40} busy choice")
    rows = []
    for name in arguments.scenes.split(","):
        with tempfile.TemporaryDirectory() as folder:
            digits = [int(k) for k in arguments.digits.split(",")]
            rows += measure(name, digits, arguments.busy, arguments.pilot, Path(folder))
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
