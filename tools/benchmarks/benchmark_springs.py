"""How fast the explicit spring step is: against the same step in OpenCL and in C, and against atomics.

    python tools/benchmarks/benchmark_springs.py [--counts 4096 1000000] [--repeats 15] [--threads 2] [--no-pin] [--json FILE]

Leapfrog, without damping and with damping along the axis of the springs, f32 and f64, on a square sheet with diagonals whose
particles are numbered row by row (`rows`) or at random (`random`), as those of a network that was read from a file. All
contenders in one process and interleaved; medians of the repeats, ratios of neighbouring samples. The positions of each are
compared with NumPy in float64 in the run that is timed, and the bits of two of our own runs with each other.

`ours` is the program's own step under the plan that it chooses; `opencl` is the runner of opencl/ on the CPU device, with the
best of several work-group sizes; `c` is tools/benchmarks/reference_springs.c on all threads, `c 1` on one; `atomic` is a
parallel
step in Taichi with the force added to both ends of each spring by atomics. What is not here (a compiler, an OpenCL device) is
skipped. A bar holds when both the medians and the fastest samples keep it: on a machine that others use, spinning threads of
OpenMP wait for each other much longer than they work, and only the fastest samples tell what the code can do.

The share of the bandwidth is the rate of the bytes that a step without damping needs, divided by the rate of the bytes of a
copy in Taichi in the same process. Each byte is counted once (compare/work.py), with the last drift of a step joined to the
first drift of the next step.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout

from spring_contenders import (  # noqa: E402
    CHECKED_STEPS,
    Atomic,
    C,
    OpenCL,
    Ours,
    compile_reference,
    numpy_positions,
    sheet,
    steps_per_sample,
)
from verdicts import finish  # noqa: E402

from mpp_taichi.compare.work import Work  # noqa: E402

COUNTS = (4096, 1_000_000)
LARGE = 500_000  # springs; the numbers of fewer springs lie in the caches, whatever the bandwidth of the memory is
PAUSE = 0.005  # seconds between contenders, for spinning threads to go to sleep
# Of the largest difference from NumPy, relative to the extent of the sheet: two additions to a place in each step round it by
# half an ulp of at most the extent; as much again for all other roundings.
LIMITS = {precision: 4 * CHECKED_STEPS * unit for precision, unit in (("f32", 2.0**-24), ("f64", 2.0**-53))}
LEAST_SHARE = 0.7  # of the bandwidth, for the step of the largest sheet in rows
BARS = {"opencl": 1.0, "c": 0.6, "atomic": 2.0}  # least speed of `ours` over the contender


def benchmark(snapshot, precision, damped, library, device, threads, repeats):
    """One row per contender: seconds per step, half-springs per second, our speed over it, difference from NumPy."""
    contenders = {"ours": Ours(snapshot, damped)}
    if library is not None:
        contenders["c"] = C(library, threads, precision, snapshot, damped)
        contenders["c 1"] = C(library, 1, precision, snapshot, damped)
    if device is not None:
        contenders["opencl"] = OpenCL(device, precision, snapshot, damped)
    if not damped:
        contenders["atomic"] = Atomic(snapshot, damped)
    expected = numpy_positions(snapshot, damped)
    size = np.abs(expected).max()
    if np.abs(expected - snapshot.position).max() < 1e3 * LIMITS["f64"] * size:
        raise RuntimeError("the sheet does not move, so that agreement would mean nothing")
    rows = {}
    for name, contender in contenders.items():
        contender.restart()
        contender.advance(CHECKED_STEPS)
        found = contender.positions()
        rows[name] = {"difference": float(np.abs(found - expected).max() / size)}
        if name == "ours":
            rows[name]["plan"] = contender.plan
            contender.restart()
            contender.advance(CHECKED_STEPS)
            rows[name]["same_bits"] = bool(np.array_equal(found, contender.positions()))
        if name == "opencl":
            rows[name]["variant"] = contender.variant
    loops = {name: steps_per_sample(contender) for name, contender in contenders.items()}
    seconds = {name: [] for name in contenders}
    names = list(contenders)
    for repeat in range(repeats):
        turn = repeat % len(names)
        for name in names[turn:] + names[:turn]:  # nobody always follows the one that leaves the caches coldest
            contenders[name].restart()
            time.sleep(PAUSE)
            contenders[name].advance(1)
            began = time.perf_counter()
            contenders[name].advance(loops[name])
            seconds[name].append((time.perf_counter() - began) / loops[name])
    for name, times in seconds.items():
        low, median, high = np.percentile(times, [25, 50, 75])
        rows[name] |= {
            "seconds": median,
            "fastest": min(times),
            "quartiles": [low, high],
            "half_springs_per_second": 2 * len(snapshot.springs) / median,
            "speed_of_ours": float(np.median(np.divide(times, seconds["ours"]))),
            "speed_of_our_fastest": min(times) / min(seconds["ours"]),
        }
    return rows


def share_of_bandwidth(case):
    """Bytes that the step needs by the second, divided by the bytes of a copy by the second; None with damping."""
    if case["damped"]:
        return None
    needed = Work(case["particles"], case["springs"], 0, evaluations=1, drifts=1, damped=False).bytes(case["precision"])
    return needed / case["rows"]["ours"]["seconds"] / case["bandwidth"]


def judge(results):
    """Each bar with what was measured: (text, value, bar, held)."""
    verdicts = []
    for case in results:
        where = f"{case['springs']} springs, {case['order']}, {case['precision']}, {'damped' if case['damped'] else 'undamped'}"
        for name, bar in BARS.items():
            if name in case["rows"]:
                ratio = min(case["rows"][name][key] for key in ("speed_of_ours", "speed_of_our_fastest"))
                verdicts.append((f"{where}: speed ÷ {name}, at least", ratio, bar, ratio >= bar))
        if case["springs"] > LARGE and case["order"] == "rows" and not case["damped"]:
            share = share_of_bandwidth(case)
            verdicts.append((f"{where}: share of the bandwidth, at least", share, LEAST_SHARE, share >= LEAST_SHARE))
    for precision, limit in LIMITS.items():
        cases = [case for case in results if case["precision"] == precision]
        worst = max((row["difference"] for case in cases for row in case["rows"].values()), default=0.0)
        verdicts.append((f"{precision}: difference from NumPy, below", worst, limit, worst < limit))
    same = all(case["rows"]["ours"]["same_bits"] for case in results)
    verdicts.append(("our bits repeat", float(same), 1.0, same))
    return verdicts


def show(case):
    """One table."""
    kind = "damped" if case["damped"] else "undamped"
    print(f"\n{case['springs']} springs, {case['particles']} particles, {case['order']} order, {case['precision']}, {kind}")
    if not case["damped"]:
        print(f"bandwidth of a copy {case['bandwidth'] / 1e9:.1f} GB/s, of which the step needs {share_of_bandwidth(case):.2f}")
    print(
        f"{'':8}{'µs a step':>11}{'quartiles':>23}{'fastest':>11}{'G half-springs/s':>18}"
        f"{'ours is faster by':>22}{'difference':>12}"
    )
    for name, row in case["rows"].items():
        low, high = row["quartiles"]
        note = "".join(f"  {key} {row[key]}" for key in ("plan", "variant") if key in row)
        print(
            f"{name:8}{1e6 * row['seconds']:11.1f}{f'{1e6 * low:.1f} – {1e6 * high:.1f}':>23}{1e6 * row['fastest']:11.1f}"
            f"{row['half_springs_per_second'] / 1e9:18.3f}{row['speed_of_ours']:15.2f}{row['speed_of_our_fastest']:7.2f}"
            f"{row['difference']:12.1e}{note}",
            flush=True,
        )


def main():
    """Run, print, write; exit code 1 when a bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS)
    parser.add_argument("--orders", nargs="+", choices=("rows", "random"), default=("rows", "random"))
    parser.add_argument("--precisions", nargs="+", choices=("f32", "f64"), default=("f32", "f64"))
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument(
        "--threads", type=int, default=len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count()
    )
    parser.add_argument("--no-pin", action="store_true", help="leave the threads to the scheduler")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    pinned = sys.platform == "linux" and not options.no_pin
    cores = sorted(os.sched_getaffinity(0)) if pinned else []
    if pinned:
        os.environ["OMP_PROC_BIND"] = "true"
        os.environ["POCL_AFFINITY"] = "1"
    os.environ["POCL_MAX_PTHREAD_COUNT"] = str(options.threads)
    from benchmark_pairs import pin_workers

    from mpp_taichi.compare.opencl_package import load_opencl
    from mpp_taichi.compare.taichi_peaks import taichi_peaks
    from mpp_taichi.device import backends

    found, reason = load_opencl().devices()
    device = next((one for one in found if one.type == "cpu"), None)
    opencl = device.id if device else f"skipped, {reason or 'no CPU among the devices'}"
    results = []
    with tempfile.TemporaryDirectory() as folder:
        library, compiler = compile_reference(folder)
        for precision in options.precisions:
            if pinned:
                os.sched_setaffinity(0, cores)
            before = set(os.listdir("/proc/self/task")) if pinned else set()
            taichi_device = backends.start("cpu", precision, threads=options.threads)
            if pinned:
                pin_workers(before, options.threads, cores)
            if not results:
                print(f"{taichi_device.name}, {options.threads} threads; pinned: {pinned}")
                print(f"C: {compiler if library else 'skipped, ' + compiler}\nOpenCL: {opencl}")
            bandwidth = taichi_peaks(taichi_device)["bytes"]
            for count in options.counts:
                for order in options.orders:
                    snapshot = sheet(count, order)
                    for damped in (False, True):
                        rows = benchmark(snapshot, precision, damped, library, device, options.threads, options.repeats)
                        case = {"springs": len(snapshot.springs), "particles": snapshot.particle_count, "order": order}
                        case |= {"precision": precision, "damped": damped, "bandwidth": bandwidth}
                        results.append(case | {"rows": rows})
                        show(results[-1])
            backends.stop()
    return finish(
        judge(results), results, options.json,
        processor=taichi_device.name, threads=options.threads, pinned=pinned, compiler=compiler, opencl=opencl,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
