"""Does gravity by a tree keep its accuracy, also where pulls cancel?

    python tools/benchmarks/benchmark_tree_accuracy.py [--count 10000] [--kinds row shell …] [--accuracies 1e-2 1e-3 …]
        [--precisions f32 f64] [--backend cpu] [--json FILE]

For each distribution of tree_bodies.py, the errors of all forces, or of `SAMPLE` of them, against sums over pairs in float64.
An error e of an acceleration a is given as (e − 32 u Σ_j |a_ij|) / |a|, with the unit round-off u: the part that is not
round-off (docs/gravity.md). The accuracy has to hold for 99 % of the bodies; if it does not, the exit code is 1. A time is the
processor time of one force, divided by the number of threads.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout

from tree_bodies import KINDS, bodies, exact  # noqa: E402
from verdicts import finish  # noqa: E402

SAMPLE = 2000
ROUNDINGS = 32.0  # u Σ_j |a_ij|: round-off of a force
UNIT = {"f32": (np.float32, 2.0**-24), "f64": (np.float64, 2.0**-53)}  # type and unit round-off u
REPEATS = 5


def build(count):
    """A tree over so many bodies without softening, and the state that it reads and writes."""
    from mpp_taichi.forces.newtonian_gravity import NewtonianGravity
    from mpp_taichi.neighbors.tree import TreeSum
    from mpp_taichi.snapshot import Snapshot
    from mpp_taichi.state.state import State
    from mpp_taichi.state.vector_layout import VectorLayout

    zeros, every = np.zeros((count, 3)), np.ones((count, 3), bool)
    snapshot = Snapshot(zeros, zeros, np.ones(count), np.ones(count), np.zeros(count), zeros, every, ("",) * count)
    force = NewtonianGravity(strength=1.0, softening=0.0, solver="tree", accuracy=None)
    return State(snapshot, dimensions=3, needs=force.needs, scratch_count=0, layout=VectorLayout.BY_COMPONENT), TreeSum(
        force, count, 3
    )


def measure(kind, state, tree, options, precision):
    """Rows of one distribution, by accuracy."""
    dtype, unit = UNIT[precision]
    position, mass = bodies(kind, options.count, dtype)
    rows = np.random.default_rng(1).choice(options.count, min(options.count, SAMPLE), replace=False)
    reference, strength = exact(position, mass, rows)
    state.write(position, np.zeros_like(position))
    state.mass.from_numpy(mass.astype(dtype))
    found = {}
    for tree.accuracy in options.accuracies:
        seconds = []
        for _ in range(REPEATS):
            state.acceleration.fill(0)
            start = time.process_time()
            tree.add_accelerations(state)
            result = state.acceleration.to_numpy().astype(float)
            seconds.append((time.process_time() - start) / options.threads)
        error = np.linalg.norm(result[rows] - reference, axis=1)
        error = np.maximum(error - ROUNDINGS * unit * strength, 0.0) / np.linalg.norm(reference, axis=1)
        found[f"{tree.accuracy:g}"] = {
            "error_99": float(np.percentile(error, 99)),
            "share": float(np.mean(error <= tree.accuracy)),
            "seconds": float(np.median(seconds)),
        }
    return found


def main():
    """Run, print, write; the exit code is 1 where an accuracy is not kept."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--accuracies", type=float, nargs="+", default=(1e-2, 1e-3, 1e-4, 1e-5))
    parser.add_argument("--precisions", nargs="+", choices=UNIT, default=tuple(UNIT))
    parser.add_argument("--backend", default="cpu")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    from mpp_taichi.device import backends

    results, verdicts = {}, []
    for precision in options.precisions:
        device = backends.start(options.backend, precision, threads=options.threads if options.backend == "cpu" else None)
        state, tree = build(options.count)
        print(f"\n{device.name}, {precision}, {options.count:,} bodies: 99th percentile of the error ÷ accuracy, and time")
        print(f"{'accuracy':10}{''.join(f'{accuracy:10g}{chr(32) * 12}' for accuracy in options.accuracies)}")
        results[precision] = {}
        for kind in options.kinds:
            table = results[precision][kind] = measure(kind, state, tree, options, precision)
            cells = [f"{row['error_99'] / float(key):10.2f} ({1e3 * row['seconds']:6.1f} ms)" for key, row in table.items()]
            print(f"{kind:10}{''.join(cells)}", flush=True)
        share = min(row["share"] for table in results[precision].values() for row in table.values())
        verdicts.append((f"{precision}: smallest share of bodies within the accuracy, at least", share, 0.99, share >= 0.99))
        backends.stop()
    return finish(verdicts, results, options.json, processor=device.name, threads=options.threads, count=options.count)


if __name__ == "__main__":
    sys.exit(main())
