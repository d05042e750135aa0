"""How fast a step is in OpenCL beside the program's own, on the same processor.

    python tools/benchmarks/benchmark_opencl.py [--models gravity spheres] [--sizes 1024 …] [--repeats 7] [--threads 2]
        [--ladder]
                                     [--no-pin] [--cpu-time] [--json FILE]

Leapfrog steps, f32 and f64: softened gravity between all bodies, and inelastic hard spheres in a box, the pairwise step. Both
contenders in one process and interleaved; medians and quartiles of the repeats, ratios of neighbouring samples. In the run that
is timed, forces are compared with NumPy in float64, and positions after some steps with each other. `ours` is the program's
step under the plan that it chooses; `opencl` is the runner of opencl/ on the CPU device, with the variant and the work-group
size that its own search finds fastest; with --ladder also every variant of the direct sum by its name. Springs are in
tools/benchmarks/benchmark_springs.py. On a machine that others use, `--cpu-time` compares the work itself: seconds of
processor time of all threads instead of the wall clock's.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout

from benchmark_pairs import bodies, pin_workers  # noqa: E402
from verdicts import finish  # noqa: E402

SIZES = {"gravity": (1024, 2048, 4096, 8192, 16384, 32768, 65536), "spheres": (1024, 16384, 131072)}
LADDER = ("naive", "tiled", "vectors", "third_law")
LADDER_UP_TO = 8192
DT = {"gravity": 1e-5, "spheres": 0.01}
SOFTENING = 1.0 / 64
PACKING = 0.3
SMALLEST_SAMPLE = 0.05  # seconds of repeated steps that one sample of the clock covers
PAUSE = 0.005  # seconds between contenders, for spinning threads to go to sleep
CHECKED_STEPS = 4
FORCE_ROWS = 256  # bodies whose forces are compared with NumPy
LIMITS = {"f32": 5e-6, "f64": 1e-13}  # of the difference from NumPy, relative to the largest acceleration
BAR = 1.0  # least speed of `ours` over `opencl`


def scene(model, count):
    """Spec and particles."""
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.snapshot import Snapshot

    if model == "gravity":
        position, mass = bodies(count)
        velocity, radius = np.zeros((count, 3)), np.zeros(count)
        effects = {"forces": [{"newtonian_gravity": {"strength": 1.0, "softening": SOFTENING}}]}
    else:
        position, velocity, edge = gas(count)
        count = len(position)
        mass = radius = np.ones(count)
        effects = {
            "contacts": {"hard_spheres": {"solver": "pairwise", "restitution": 0.95}},
            "walls": [{"box": {"lower": [0, 0, 0], "upper": [edge] * 3}}],
        }
    places = ([1.0, 1.0, 1.0], [4.0, 1.0, 1.0])  # of two that stand for all in the text of the scene
    pair = [{"body": {"mass": 1.0, "radius": 1.0, "position": place}} for place in places]
    spec = load_scene({"title": model, "particles": pair, "integrator": {"leapfrog": {"dt": DT[model]}}} | effects)
    zeros, free = np.zeros(count), np.ones((count, 3), bool)
    return spec, Snapshot(position, velocity, mass, radius, zeros, np.ones((count, 3)), free, ("",) * count)


def gas(count):
    """Unit spheres moved at random within the cells of a lattice: positions, velocities, edge of the box."""
    random = np.random.default_rng(count)
    along, cell = round(count ** (1 / 3)), (4 * np.pi / 3 / PACKING) ** (1 / 3)
    lattice = np.stack(np.meshgrid(*[np.arange(along)] * 3, indexing="ij"), -1).reshape(-1, 3)
    position = (lattice + 0.5) * cell + random.uniform(-0.5, 0.5, lattice.shape) * (cell - 2.0)
    return position, random.normal(size=lattice.shape), float(along * cell)


class Ours:
    """The program's own step."""

    def __init__(self, spec, start, device):
        from mpp_taichi.simulation.compiled_phase import CompiledPhase
        from mpp_taichi.simulation.course import Phase

        phase = Phase(-np.inf, spec, start, {})
        self.compiled = CompiledPhase(phase, device, plan="auto", replica_starts=(), event_log=False)
        self.start, self.dt, self.variant = start, float(spec.integrator.parameters["dt"]), self.compiled.plan
        self.restart()

    def restart(self):
        """Go back to the start."""
        self.compiled.state.write(self.start.position, self.start.velocity)
        self.compiled.launcher.prepare(0.0, self.dt)

    def advance(self, steps):
        """Run steps."""
        self.compiled.launcher.advance(0.0, self.dt, 0, steps)

    def positions(self):
        """Where the particles are."""
        return self.compiled.state.read()[0]

    def accelerations(self):
        """Of all forces at the start."""
        self.compiled.launcher.force_sum.add_up(self.compiled.total_force, 0.0)
        return self.compiled.state.acceleration.to_numpy().astype(np.float64)

    def close(self):
        """Give the memory back."""
        if self.compiled.contacts is not None:
            self.compiled.contacts.destroy()
        self.compiled.state.destroy()


class OpenCL:
    """The runner of opencl/."""

    def __init__(self, spec, start, device, precision, variant=None):
        from mpp_taichi.compare.opencl_package import load_opencl

        self.runner = load_opencl().Runner(spec, start, device=device, precision=precision, variant=variant)
        self.start, self.variant, self.close = start, self.runner.variant, self.runner.close
        self.advance, self.accelerations = self.runner.advance, self.runner.accelerations

    def restart(self):
        """Go back to the start."""
        self.runner.restart(self.start)

    def positions(self):
        """Where the particles are."""
        return self.runner.snapshot().position


def exact_forces(start):
    """Accelerations of some bodies in float64, and which."""
    rows = np.linspace(0, start.particle_count - 1, min(FORCE_ROWS, start.particle_count)).astype(int)
    result = []
    for i in rows:
        d = start.position - start.position[i]
        result.append((start.mass / (np.einsum("ij,ij->i", d, d) + SOFTENING**2) ** 1.5) @ d)
    return np.array(result), rows


def benchmark(model, count, precision, taichi_device, opencl_device, repeats, ladder, clock):
    """One row per contender: seconds per step, work per second, our speed over it, differences."""
    spec, start = scene(model, count)
    contenders = {"ours": Ours(spec, start, taichi_device), "opencl": OpenCL(spec, start, opencl_device, precision)}
    if ladder and model == "gravity" and count <= LADDER_UP_TO:
        contenders |= {name: OpenCL(spec, start, opencl_device, precision, name) for name in LADDER}
    rows, ends, exact = {}, {}, exact_forces(start) if model == "gravity" else None
    for name, contender in contenders.items():
        rows[name] = {"variant": contender.variant}
        contender.restart()
        if exact is not None:
            difference = np.abs(contender.accelerations()[exact[1]] - exact[0]).max()
            rows[name]["force_error"] = float(difference / np.linalg.norm(exact[0], axis=1).max())
            contender.restart()
        contender.advance(CHECKED_STEPS)
        ends[name] = contender.positions()
    loops = {name: steps_of_a_sample(contender) for name, contender in contenders.items()}
    seconds = {name: [] for name in contenders}
    names = list(contenders)
    for repeat in range(repeats):
        turn = repeat % len(names)
        for name in names[turn:] + names[:turn]:  # nobody always follows the one that leaves the caches coldest
            contenders[name].restart()
            time.sleep(PAUSE)
            contenders[name].advance(1)
            began = clock()
            contenders[name].advance(loops[name])
            seconds[name].append((clock() - began) / loops[name])
    work = start.particle_count * ((start.particle_count - 1) if model == "gravity" else 1)
    for name, times in seconds.items():
        low, median, high = np.percentile(times, [25, 50, 75])
        rows[name] |= {
            "seconds": median,
            "fastest": min(times),
            "quartiles": [low, high],
            "work_per_second": work / median,
            "speed_of_ours": float(np.median(np.divide(times, seconds["ours"]))),
            "speed_of_our_fastest": min(times) / min(seconds["ours"]),
            "difference": float(np.abs(ends[name] - ends["ours"]).max()),
        }
    for contender in contenders.values():
        contender.close()
    return rows


def steps_of_a_sample(contender):
    """So many that the clock has something to measure; restarted often enough that nothing has moved far."""
    began = time.perf_counter()
    contender.advance(1)
    return max(1, min(64, int(SMALLEST_SAMPLE / (time.perf_counter() - began))))


def show(case):
    """One table."""
    unit = "G pairs/s" if case["model"] == "gravity" else "M steps/s"
    scale = 1e9 if case["model"] == "gravity" else 1e6
    print(f"\n{case['model']}, {case['count']} particles, {case['precision']}")
    print(f"{'':10}{'ms a step':>11}{'quartiles':>23}{unit:>11}{'ours is faster by':>20}{'force error':>13}{'way apart':>11}")
    for name, row in case["rows"].items():
        low, high = row["quartiles"]
        error = f"{row['force_error']:.1e}" if "force_error" in row else "–"
        spread, rate = f"{1e3 * low:.3f} – {1e3 * high:.3f}", row["work_per_second"] / scale
        faster = f"{row['speed_of_ours']:13.2f}{row['speed_of_our_fastest']:7.2f}"
        apart = f"{row['difference']:11.1e}  {row['variant']}"
        print(f"{name:10}{1e3 * row['seconds']:11.3f}{spread:>23}{rate:11.2f}{faster}{error:>13}{apart}", flush=True)


def judge(results):
    """Each bar with what was measured: (text, value, bar, held)."""
    verdicts = []
    for case in results:
        where = f"{case['model']}, {case['count']}, {case['precision']}"
        row = case["rows"]["opencl"]
        ratio = min(row["speed_of_ours"], row["speed_of_our_fastest"])
        verdicts.append((f"{where}: speed ÷ opencl, at least", ratio, BAR, ratio >= BAR))
        for name, one in case["rows"].items():
            if "force_error" in one:
                error, limit = one["force_error"], LIMITS[case["precision"]]
                verdicts.append((f"{where}: force error of {name}, below", error, limit, error < limit))
    return verdicts


def main():
    """Run, print, write; exit code 1 when a bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", nargs="+", choices=tuple(SIZES), default=tuple(SIZES))
    parser.add_argument("--sizes", type=int, nargs="+", help="instead of those of each model")
    parser.add_argument("--precisions", nargs="+", choices=("f32", "f64"), default=("f32", "f64"))
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--ladder", action="store_true", help="every variant of the direct sum as well")
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
        os.environ["POCL_AFFINITY"] = "1"
    os.environ["POCL_MAX_PTHREAD_COUNT"] = str(options.threads)

    from mpp_taichi.compare.opencl_package import load_opencl
    from mpp_taichi.device import backends

    found, reason = load_opencl().devices()
    device = next((one for one in found if one.type == "cpu"), None)
    if device is None:
        print(f"nothing to compare with: {reason or 'no CPU among the OpenCL devices'}")
        return 0
    results = []
    for precision in options.precisions:
        before = set(os.listdir("/proc/self/task")) if pinned else set()
        taichi_device = backends.start("cpu", precision, threads=options.threads)
        if pinned:
            pin_workers(before, options.threads, cores)
        if not results:
            print(f"{taichi_device.name}, {options.threads} threads; pinned: {pinned}; clock: {clock.__name__}")
            print(f"OpenCL: {device.id}")
        for model in options.models:
            for count in options.sizes or SIZES[model]:
                rows = benchmark(model, count, precision, taichi_device, device, options.repeats, options.ladder, clock)
                results.append({"model": model, "count": count, "precision": precision, "rows": rows})
                show(results[-1])
        backends.stop()
    return finish(
        judge(results), results, options.json,
        processor=taichi_device.name, threads=options.threads, pinned=pinned, clock=clock.__name__, opencl=device.id,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
