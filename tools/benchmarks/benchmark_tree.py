"""How fast and how exact gravity by a tree is: against the direct sum, and packages that pip brings where they are there.

    python tools/benchmarks/benchmark_tree.py [--sizes 1000 3000 …] [--accuracies 1e-2 1e-3 …] [--kind sphere] [--peers]
        [--json FILE]

One force of N bodies without softening, f32 and f64. Errors are those of sampled bodies against pair sums in NumPy in float64:
the median and the 99th percentile. Tree and direct sum are timed in turn; above `LARGEST_DIRECT` bodies the direct sum's time
is that of `LARGEST_DIRECT`, scaled with N², and said to be so. `--peers` runs, where they can be imported, pytreegrav
(Barnes–Hut, with Numba) and fmm3dpy (the Flatiron Institute's FMM3D), at the loosest setting that keeps the accuracy, in
f64 with as many threads. `--cpu-time` counts processor time over the threads instead of the wall clock, for a machine that
others use, too.
"""

import argparse
import math
import os
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout

from tree_bodies import KINDS, bodies, exact  # noqa: E402
from verdicts import finish  # noqa: E402

SIZES = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
LARGEST_DIRECT = 30_000
SAMPLE = 500
FMM_TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)  # of fmm3dpy, largest first
ANGLES = (1.0, 0.7, 0.5, 0.35)  # of pytreegrav, largest first
BAR = 30.0  # times the direct sum's speed, at 1,000,000 bodies and an accuracy of 1e-3


def program(position, mass, accuracies):
    """Calls of the direct sum (where it is affordable) and of the tree at each accuracy, by name, and what reads the result."""
    from mpp_taichi.forces.newtonian_gravity import NewtonianGravity
    from mpp_taichi.neighbors.all_pairs import AllPairs
    from mpp_taichi.neighbors.tree import TreeSum
    from mpp_taichi.snapshot import Snapshot
    from mpp_taichi.state.state import State
    from mpp_taichi.state.vector_layout import VectorLayout

    count = len(mass)
    zeros = np.zeros((count, 3))
    snapshot = Snapshot(position, zeros, mass, np.ones(count), np.zeros(count), zeros, np.ones((count, 3), bool), ("",) * count)
    force = NewtonianGravity(strength=1.0, softening=0.0, solver="tree", accuracy=None)
    state = State(snapshot, dimensions=3, needs=force.needs, scratch_count=0, layout=VectorLayout.BY_COMPONENT)
    tree, pairs = TreeSum(force, count, 3), AllPairs((force,), count, 3)

    def by_tree(accuracy):
        def call():
            tree.accuracy = accuracy
            state.acceleration.fill(0)
            tree.add_accelerations(state)

        return call

    def by_pairs():
        state.acceleration.fill(0)
        pairs.add_accelerations(state)

    calls = {f"tree {accuracy:g}": by_tree(accuracy) for accuracy in accuracies}
    if count <= LARGEST_DIRECT:
        calls["direct"] = by_pairs
    return calls, state.acceleration.to_numpy


def peers(position, mass, accuracies, error_of):
    """Calls of other packages, each with its accelerations as the result, at the loosest setting that keeps the accuracy."""
    settings = {}
    try:
        import fmm3dpy

        source = np.asfortranarray(position.T)
        settings["fmm3d ε"] = (
            FMM_TOLERANCES,
            lambda eps: 4.0 * math.pi * fmm3dpy.lfmm3d(eps=eps, sources=source, charges=mass, pg=2).grad.T,
        )
    except ImportError as reason:
        print(f"fmm3dpy: {reason}")
    try:
        from pytreegrav import Accel

        softening = np.zeros(len(mass))
        settings["pytreegrav θ"] = (
            ANGLES,
            lambda theta: Accel(position, mass, softening, theta=theta, method="tree", parallel=True, quadrupole=True),
        )
    except ImportError as reason:
        print(f"pytreegrav: {reason}")
    calls = {}
    for accuracy in accuracies:
        for name, (values, function) in settings.items():
            value = next((each for each in values if error_of(function(each))[1] <= accuracy), values[-1])
            calls[f"{accuracy:g}: {name} = {value:g}"] = partial(function, value)
    return calls


def measure(calls, repeats, clock):
    """Seconds of each call, in turn, after a first one that is not counted."""
    import taichi as ti

    samples = {name: [] for name in calls}
    for repeat in range(repeats + 1):
        for name, call in calls.items():
            start = clock()
            call()
            ti.sync()
            if repeat:
                samples[name].append(clock() - start)
    return samples


def benchmark(kind, size, accuracies, options, clock, direct_rate):
    """Rows of one size, and the direct sum's pairs per second."""
    position, mass = bodies(kind, size)
    rows = np.random.default_rng(1).choice(size, min(size, SAMPLE), replace=False)
    reference, _ = exact(position, mass, rows)

    def error_of(found):
        errors = np.linalg.norm(found[rows] - reference, axis=1) / np.linalg.norm(reference, axis=1)
        return np.percentile(errors, [50, 99])

    calls, read = program(position, mass, accuracies)
    found = {}
    for name, call in calls.items():
        call()
        found[name] = error_of(read().astype(float))
    if options.peers and options.precision == "f64":
        for name, call in peers(position, mass, accuracies, error_of).items():
            calls[name] = call
            found[name] = error_of(call())
    samples = measure(calls, max(1, options.repeats if size < 300_000 else options.repeats // 2), clock)
    scale = options.threads if options.cpu_time else 1
    table = {}
    for name, seconds in samples.items():
        median, low, high = (float(value) / scale for value in np.percentile(seconds, [50, 25, 75]))
        table[name] = {"seconds": median, "quartiles": [low, high], "error_50": found[name][0], "error_99": found[name][1]}
    if "direct" in table:
        direct_rate = size * (size - 1) / table["direct"]["seconds"]
    direct = size * (size - 1) / direct_rate
    for row in table.values():
        row["direct_over_this"] = direct / row["seconds"]
    return table, direct_rate


def show(kind, size, table):
    """One size."""
    print(f"\n{kind}, {size:,} bodies\n{'':34}{'ms':>10}{'µs per body':>13}{'direct ÷ this':>15}{'error 50 %':>12}{'99 %':>9}")
    for name, row in table.items():
        ms, each = 1e3 * row["seconds"], 1e6 * row["seconds"] / size
        ratio = f"{row['direct_over_this']:15.1f}"
        print(f"{name:34}{ms:10.1f}{each:13.2f}{ratio}{row['error_50']:12.1e}{row['error_99']:9.1e}", flush=True)


def main():
    """Run, print, write; exit code 1 when the bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--accuracies", type=float, nargs="+", default=(1e-3,))
    parser.add_argument("--kind", choices=KINDS, default="sphere")
    parser.add_argument("--precisions", nargs="+", default=("f32", "f64"))
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--peers", action="store_true", help="pytreegrav and fmm3dpy beside, in f64")
    parser.add_argument("--cpu-time", action="store_true", help="processor time over the threads, for busy machines")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = str(options.threads)
    clock = time.process_time if options.cpu_time else time.perf_counter
    from mpp_taichi.device import backends

    results = {}
    for precision in options.precisions:
        options.precision, rate, results[precision] = precision, math.nan, {}
        for size in options.sizes:
            device = backends.start("cpu", precision, threads=options.threads)
            if size > LARGEST_DIRECT and not rate > 0.0:
                rate = benchmark(options.kind, LARGEST_DIRECT, (), options, clock, rate)[1]
            table, rate = benchmark(options.kind, size, options.accuracies, options, clock, rate)
            results[precision][str(size)] = table
            show(f"{device.name}, {options.threads} threads, {precision}: {options.kind}", size, table)
            backends.stop()
    if max(options.sizes) > LARGEST_DIRECT:
        print(f"\nthe direct sum above {LARGEST_DIRECT:,} bodies: its pairs per second at the largest size below, times N²")
    verdicts = []
    for precision, sizes in results.items():
        row = sizes.get("1000000", {}).get("tree 0.001")
        if row is not None:
            speed, error = row["direct_over_this"], float(row["error_99"])
            verdicts.append((f"1,000,000 bodies, {precision}: speed ÷ direct, at least", speed, BAR, speed >= BAR))
            verdicts.append((f"1,000,000 bodies, {precision}: error of 99 %, at most", error, 1e-3, error <= 1e-3))
    return finish(
        verdicts, results, options.json,
        processor=device.name, threads=options.threads, clock=clock.__name__, kind=options.kind, largest_direct=LARGEST_DIRECT,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
