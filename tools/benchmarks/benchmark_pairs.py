"""How fast the direct pair sum is: against C by hand, a hand-written Taichi kernel, Numba, REBOUND and NumPy.

    python tools/benchmarks/benchmark_pairs.py [--sizes 1024 2048 …] [--repeats 9] [--threads 2] [--no-pin] [--cpu-time]
        [--json FILE]

Softened gravity, f32 and f64, all contenders in one process and interleaved; medians and quartiles of the repeats. Each result
is compared with NumPy in float64 in the run that is timed. `composed` is the program's own sum with the formula of
forces/newtonian_gravity.py handed in, `gather` the one that it takes for few bodies, in which every body looks at all others,
`hand` that loop written out for gravity alone, `inlined` the same as it is inside a larger kernel, without explicit vectors. C
is tools/benchmarks/reference_pairs.c, skipped where there is no compiler, as Numba and REBOUND (one thread, f64) are where
they are not installed (`pip install .[bench]`).

The worker threads of Taichi are pinned to a core each (Linux), as those of OpenMP are: woken together they otherwise
often share one core for some milliseconds, and the clock then measures the scheduler. On a machine that others use,
`--cpu-time --threads 1` compares the work itself: seconds of processor time instead of the wall clock's.
"""

import argparse
import ctypes
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from c_reference import compile_c
from pair_contenders import numba_contender, rebound_contender
from verdicts import finish

ROOT = Path(__file__).parents[2]
SOFTENING = 1.0 / 64
SIZES = (1024, 2048, 4096, 8192, 16384)
SMALLEST_SAMPLE = 0.05  # seconds of repeated calls that one sample of the clock covers
PAUSE = 0.01  # seconds between contenders, for the spinning threads of OpenMP to go to sleep
C_FLAGS = "-O3 -march=native -mprefer-vector-width=512 -ffast-math -fopenmp -fPIC".split()
NUMPY_ROWS = 32  # rows of one block; a few arrays of 32 × N fit the cache
LIMITS = {"f32": 1e-5, "f64": 1e-13}  # of the largest difference from float64 NumPy, relative to the mean acceleration
# Speed of ours over theirs, at every size.
BARS = {("c", "f32"): 0.7, ("c", "f64"): 0.6, ("numba", "f32"): 1.0, ("numba", "f64"): 1.0, ("rebound", "f64"): 4.0}
BARS |= {("numpy", "f32"): 10.0, ("numpy", "f64"): 10.0}
COMPOSED_BAR = 1.03  # of the time of the hand-written kernel, the median over the sizes


def bodies(count):
    """Positions in a unit cube and masses near one, the same in both precisions."""
    random = np.random.default_rng(count)
    return (array.astype(np.float32).astype(np.float64) for array in (random.random((count, 3)), 0.5 + random.random(count)))


def numpy_sum(position, mass, rows):
    """Accelerations of `rows` bodies in the precision of the arrays, in blocks, without a temporary that is not reused."""
    result = np.empty((len(rows), 3), position.dtype)
    columns = [np.ascontiguousarray(position[:, axis]) for axis in range(3)]
    softening_squared = position.dtype.type(SOFTENING**2)
    for begin in range(0, len(rows), NUMPY_ROWS):
        block = rows[begin : begin + NUMPY_ROWS]
        d = [column[None] - column[block, None] for column in columns]
        squared = d[0] * d[0]
        work = d[1] * d[1]
        squared += work
        np.multiply(d[2], d[2], out=work)
        squared += work
        squared += softening_squared
        np.sqrt(squared, out=work)
        work *= squared
        np.divide(mass, work, out=work)
        for axis in range(3):
            result[begin : begin + NUMPY_ROWS, axis] = np.einsum("ij,ij->i", work, d[axis])
    return result


def compile_reference(folder):
    """The C library and a line on it, or None and the reason why there is none."""
    library, version = compile_c("reference_pairs.c", C_FLAGS, folder, without=["-mprefer-vector-width=512"])
    if library is None:
        return None, version
    library.instruction_set.restype = ctypes.c_char_p
    return library, f"{version}, {library.instruction_set().decode()}, {' '.join(C_FLAGS)}"


def c_contender(library, position, mass, precision, threads):
    """The reference on these bodies, padded with bodies of no mass to a multiple of 128."""
    kind, number = (np.float32, ctypes.c_float) if precision == "f32" else (np.float64, ctypes.c_double)
    count = len(mass)
    padded = -(-count // 128) * 128
    columns = [np.zeros(padded, kind) for _ in range(7)]
    for axis in range(3):
        columns[axis][:count] = position[:, axis]
    columns[3][:count] = mass
    pointers = [column.ctypes.data_as(ctypes.c_void_p) for column in columns]
    function = getattr(library, f"gravity_{precision}")
    arguments = (ctypes.c_int64(padded), *pointers, number(SOFTENING**2), ctypes.c_int(threads))
    return lambda: function(*arguments), lambda: np.stack([column[:count] for column in columns[4:]], axis=1)


def taichi_contenders(position, mass):
    """`composed`, `inlined` and `hand`: a call each, and the accelerations after it."""
    import taichi as ti

    from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
    from mpp_taichi.forces.newtonian_gravity import NewtonianGravity
    from mpp_taichi.neighbors.all_pairs import AllPairs
    from mpp_taichi.snapshot import Snapshot
    from mpp_taichi.state.state import State
    from mpp_taichi.state.vector_layout import VectorLayout

    count = len(mass)
    zeros = np.zeros((count, 3))
    snapshot = Snapshot(position, zeros, mass, np.ones(count), np.zeros(count), zeros, np.ones((count, 3), bool), ("",) * count)
    force = NewtonianGravity(strength=1.0, softening=SOFTENING)
    state = State(snapshot, dimensions=3, needs=force.needs, scratch_count=0, layout=VectorLayout.BY_COMPONENT)
    pairs = AllPairs((force,), count, 3)
    lanes, threads, tiles, outside = pairs.lane_count, pairs.thread_count, pairs.tile_count, count - pairs.lane_count
    x, m, a = state.position, state.mass, state.acceleration
    softening_squared = SOFTENING**2

    @ti.func
    def column(begin, axis: ti.template()):
        return ti.Vector([x[begin + lane][axis] for lane in ti.static(range(lanes))])

    @ti.kernel
    def hand_written():
        for block in range(threads * 512):
            if block % 512 == 0:
                for tile in range(block // 512 * tiles // threads, (block // 512 + 1) * tiles // threads):
                    b = tile * lanes
                    px, py, pz = column(b, 0), column(b, 1), column(b, 2)
                    sx, sy, sz = ti.Vector.zero(float, lanes), ti.Vector.zero(float, lanes), ti.Vector.zero(float, lanes)
                    for pair in range(outside // 2):
                        j = 2 * pair + ti.select(2 * pair >= b, lanes, 0)
                        jx, jy, jz = x[j][0] - px, x[j][1] - py, x[j][2] - pz
                        kx, ky, kz = x[j + 1][0] - px, x[j + 1][1] - py, x[j + 1][2] - pz
                        r = ti.sqrt(jx * jx + jy * jy + jz * jz + softening_squared)
                        s = ti.sqrt(kx * kx + ky * ky + kz * kz + softening_squared)
                        both = 1.0 / (r * s)
                        u, v = both * s, both * r
                        wj, wk = m[j] * (u * u * u), m[j + 1] * (v * v * v)
                        sx, sy, sz = sx + wj * jx, sy + wj * jy, sz + wj * jz
                        sx, sy, sz = sx + wk * kx, sy + wk * ky, sz + wk * kz
                    for j in range(b, b + lanes):
                        jx, jy, jz = x[j][0] - px, x[j][1] - py, x[j][2] - pz
                        u = 1.0 / ti.sqrt(jx * jx + jy * jy + jz * jz + softening_squared)
                        wj = m[j] * (u * u * u)
                        sx, sy, sz = sx + wj * jx, sy + wj * jy, sz + wj * jz
                    for lane in ti.static(range(lanes)):
                        a[b + lane][0] = a[b + lane][0] + sx[lane]
                        a[b + lane][1] = a[b + lane][1] + sy[lane]
                        a[b + lane][2] = a[b + lane][2] + sz[lane]

    @ti.kernel
    def inlined():
        pairs.accumulate_parallel_cpu(state)

    def hand():
        with explicit_vectors():
            hand_written()

    def once(call):
        def result():
            a.fill(0)
            call()
            return a.to_numpy()

        return result

    @ti.kernel
    def gathered():
        pairs.accumulate_parallel_cpu(state)

    def gather():
        with explicit_vectors():
            gathered()

    calls = {"composed": lambda: pairs.add_accelerations(state), "gather": gather, "hand": hand, "inlined": inlined}
    if outside < 0 or count % lanes or outside % 2:
        del calls["hand"]  # it is written for whole tiles
    return {name: (call, once(call)) for name, call in calls.items()}


def ticks_of(thread):
    """Processor time that a thread has taken, in clock ticks."""
    fields = Path(f"/proc/self/task/{thread}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return int(fields[11]) + int(fields[12])


def pin_workers(before, threads, cores):
    """Give each worker thread of Taichi a core of its own: of the threads started since `before`, those that now work.

    `cores` are those of the process before OpenMP was loaded, which binds the thread that loads it to the first of them.
    """
    new = set(os.listdir("/proc/self/task")) - before
    idle = {thread: ticks_of(thread) for thread in new}
    keep_workers_busy()
    busiest = sorted(new, key=lambda thread: ticks_of(thread) - idle[thread], reverse=True)[:threads]
    for number, thread in enumerate(sorted(busiest, key=int)):
        os.sched_setaffinity(int(thread), {cores[number % len(cores)]})


def keep_workers_busy():
    """Run a parallel kernel that takes every worker some tenths of a second."""
    import taichi as ti

    total = ti.field(ti.f32, 1 << 16)

    @ti.kernel
    def work():
        for i in total:
            x = 0.5
            for _ in range(20_000):
                x = 3.7 * x * (1.0 - x)
            total[i] = x

    work()
    ti.sync()


def measure(contenders, repeats, clock):
    """Interleaved samples of seconds per call, {name: [seconds, …]}; first calls are not counted."""
    loops = {}
    for name, (call, _) in contenders.items():
        call()
        start = clock()
        call()
        loops[name] = max(1, int(SMALLEST_SAMPLE / (clock() - start)))
    samples = {name: [] for name in contenders}
    names = list(contenders)
    for repeat in range(repeats):
        turn = repeat % len(names)
        for name in names[turn:] + names[:turn]:  # nobody always follows the one that leaves caches and cores coldest
            call = contenders[name][0]
            time.sleep(PAUSE)
            call()
            start = clock()
            for _ in range(loops[name]):
                call()
            samples[name].append((clock() - start) / loops[name])
    return samples


def benchmark(size, precision, library, threads, repeats, clock):
    """One row per contender: median and quartiles in seconds, interactions per second, error.

    `composed_speed` is the speed of `composed` over this one, the median over the pairs of neighbouring samples.
    """
    position, mass = bodies(size)
    kind = np.float32 if precision == "f32" else np.float64
    contenders = taichi_contenders(position, mass)
    if library is not None:
        contenders["c"] = c_contender(library, position, mass, precision, threads)
    narrow = position.astype(kind), mass.astype(kind)
    everyone = np.arange(size)
    contenders["numpy"] = (lambda: numpy_sum(*narrow, everyone), lambda: numpy_sum(*narrow, everyone))
    contenders["numba"] = numba_contender(*narrow, SOFTENING, threads)
    contenders["rebound"] = rebound_contender(position, mass, SOFTENING) if precision == "f64" else None
    contenders = {name: contender for name, contender in contenders.items() if contender is not None}
    samples = measure(contenders, repeats, clock)
    sample = np.linspace(0, size - 1, min(size, 512)).astype(int)
    exact = numpy_sum(position, mass, sample)
    typical = np.linalg.norm(exact, axis=1).mean()
    rows = {}
    for name, (call, result) in contenders.items():
        if name == "c":
            call()
        error = float(np.abs(result()[sample] - exact).max() / typical)
        low, median, high = np.percentile(samples[name], [25, 50, 75])
        ratio = float(np.median(np.divide(samples[name], samples["composed"])))
        rows[name] = {
            "seconds": median,
            "quartiles": [low, high],
            "per_second": size * (size - 1) / median,
            "composed_speed": ratio,
            "error": error,
        }
    if "hand" in rows:
        rows["gather"]["over_hand"] = float(np.median(np.divide(samples["gather"], samples["hand"])))
    return rows


def judge(results):
    """Each bar with what was measured: (text, value, bar, held)."""
    verdicts = []
    for (opponent, precision), bar in BARS.items():
        ratios = [rows[opponent]["composed_speed"] for rows in results.get(precision, {}).values() if opponent in rows]
        if ratios:
            verdicts.append((f"{precision}: speed ÷ {opponent}, at least", min(ratios), bar, min(ratios) >= bar))
    for precision, sizes in results.items():
        ratios = [rows["gather"]["over_hand"] for rows in sizes.values() if "hand" in rows]
        if ratios:
            worst = float(np.median(ratios))
            verdicts.append((f"{precision}: gather, time ÷ hand-written, at most", worst, COMPOSED_BAR, worst <= COMPOSED_BAR))
    for precision, sizes in results.items():
        worst = max(row["error"] for rows in sizes.values() for row in rows.values())
        verdicts.append((f"{precision}: difference from float64, below", worst, LIMITS[precision], worst < LIMITS[precision]))
    return verdicts


def show(title, rows):
    """One table."""
    print(f"\n{title}\n{'':10}{'ms':>10}{'quartiles':>20}{'G pairs/s':>11}{'÷ C':>7}{'error':>10}")
    for name, row in rows.items():
        low, high = row["quartiles"]
        ratio = f"{rows['c']['seconds'] / row['seconds']:7.2f}" if "c" in rows else "      –"
        spread = f"{1e3 * low:9.3f} –{1e3 * high:9.3f}"
        print(f"{name:10}{1e3 * row['seconds']:10.3f}{spread:>20}{row['per_second'] / 1e9:11.2f}{ratio}{row['error']:10.1e}")


def main():
    """Run, print, write; exit code 1 when a bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument(
        "--threads", type=int, default=len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count()
    )
    parser.add_argument("--no-pin", action="store_true", help="leave the threads to the scheduler")
    parser.add_argument("--cpu-time", action="store_true", help="processor time of all threads, for busy machines")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    clock = time.process_time if options.cpu_time else time.perf_counter
    pinned = sys.platform == "linux" and not options.no_pin
    cores = sorted(os.sched_getaffinity(0)) if pinned else []
    if pinned:
        os.environ["OMP_PROC_BIND"] = "true"
    sys.path.insert(0, str(ROOT))
    from mpp_taichi.device import backends

    with tempfile.TemporaryDirectory() as folder:
        library, compiler = compile_reference(folder)
        results = {}
        for precision in ("f32", "f64"):
            if pinned:
                os.sched_setaffinity(0, cores)
            before = set(os.listdir("/proc/self/task")) if pinned else set()
            device = backends.start("cpu", precision, threads=options.threads)
            if pinned:
                pin_workers(before, options.threads, cores)
            if not results:
                print(f"{device.name}, {options.threads} threads for Taichi and C, one for NumPy; pinned: {pinned}")
                print(f"C: {compiler}" if library else f"C: skipped, {compiler}")
            results[precision] = {}
            for size in options.sizes:
                results[precision][str(size)] = benchmark(size, precision, library, options.threads, options.repeats, clock)
                show(f"{precision}, {size} bodies", results[precision][str(size)])
            backends.stop()
    return finish(
        judge(results), results, options.json,
        processor=device.name, threads=options.threads, pinned=pinned, clock=clock.__name__, compiler=compiler,
        softening=SOFTENING,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
