"""What does a formula cost beside the same force as a file of the package? Gravity both ways, interleaved, as a table.

    python tools/benchmarks/benchmark_formulas.py [--rounds 7] [--seconds 0.1] [--json FILE]

A round runs the component and the formula one after the other, each for about `--seconds`. The ratio is that of the medians.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that it also runs from a checkout that is not installed

from mpp_taichi import BackendError, Simulation  # noqa: E402

SOFTENING = 0.05
FORCES = {
    "component": {"newtonian_gravity": {"softening": SOFTENING}},
    "formula": {"pair": {"potential": "-m1*m2/r", "softening": SOFTENING}},
}
CASES = [
    ("cpu", "f64", 3, "leapfrog"),
    ("cpu", "f64", 20, "leapfrog"),
    ("cpu", "f64", 2000, "leapfrog"),
    ("cpu", "f32", 2000, "leapfrog"),
    ("cpu", "f64", 300, "hermite4"),
    ("vulkan", "f32", 2000, "leapfrog"),
    ("cuda", "f32", 20_000, "leapfrog"),
]


def scene(count, force, method):
    """A cube of bodies."""
    places = np.random.default_rng(1).uniform(-1.0, 1.0, (count, 3)).tolist()
    return {
        "particles": [{"body": {"position": place, "mass": 1.0 / count}} for place in places],
        "forces": [force],
        "integrator": {method: {"dt": 1e-5}},
    }


def measure(case, rounds, seconds):
    """Median seconds of a step, by the way in which the force is written."""
    backend, precision, count, method = case
    runs = {
        name: Simulation(scene(count, force, method), backend=backend, precision=precision) for name, force in FORCES.items()
    }
    steps = {}
    for name, run in runs.items():
        run.run(steps=3, judge="off")
        begin = time.perf_counter()
        run.run(steps=10, judge="off")
        steps[name] = max(3, int(10 * seconds / (time.perf_counter() - begin)))
        run.run(steps=steps[name], judge="off")
    times = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            begin = time.perf_counter()
            run.run(steps=steps["component"], judge="off")
            times[name].append((time.perf_counter() - begin) / steps["component"])
    for run in runs.values():
        run.close()
    return {name: median(each) for name, each in times.items()}


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--seconds", type=float, default=0.1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    print("| device, precision | bodies, method | newtonian_gravity, a step | formula, a step | ratio |\n|---|---|---|---|---|")
    for case in CASES:
        backend, precision, count, method = case
        try:
            found = measure(case, options.rounds, options.seconds)
        except BackendError as error:
            print(f"| {backend}, {precision} | {count:,}, {method} | {error} | | |")
            continue
        micro = {name: 1e6 * value for name, value in found.items()}
        ratio = found["formula"] / found["component"]
        rows.append({"backend": backend, "precision": precision, "bodies": count, "method": method, **found, "ratio": ratio})
        cells = f"{micro['component']:,.4g} µs | {micro['formula']:,.4g} µs | {ratio:.2f}"
        print(f"| {backend}, {precision} | {count:,}, {method} | {cells} |", flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
