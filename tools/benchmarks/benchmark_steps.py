"""What a step of a small system costs: against REBOUND, against a hand-written kernel, and from a cold start.

    python tools/benchmarks/benchmark_steps.py [--counts 2 3 9 …] [--repeats 9] [--json FILE]

Leapfrog in f64 on one thread, 2 to 64 bodies, all programs interleaved in one process, medians of the repeats. `composed` is
the program's own step; `hand` is one Taichi kernel written out for gravity alone, for up to nine bodies; both under the serial
plan. The cold start is a whole process that runs two steps of scenes/sun_earth.yaml, with and without Taichi's kernel cache.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout that is not installed

from verdicts import finish  # noqa: E402

COUNTS = (2, 3, 9, 16, 32, 64)
PAIRS = 20_000_000  # of a sample, about; no more steps than
MOST_STEPS = 200_000
LARGEST_BY_HAND = 9  # bodies; more make a kernel too long to be unrolled
DT = 1e-3
BAR = 0.5  # of REBOUND's time


def bodies(count):
    """A star and light planets on near-circular orbits: positions, velocities, masses."""
    random = np.random.default_rng(0)
    position, velocity = np.zeros((count, 3)), np.zeros((count, 3))
    mass = np.full(count, 1e-4)
    mass[0] = 1.0
    for i in range(1, count):
        angle, radius = random.uniform(0, 2 * math.pi), 1.0 + 0.5 * i
        position[i] = [radius * math.cos(angle), radius * math.sin(angle), 0.01 * i]
        velocity[i] = [-math.sin(angle) / math.sqrt(radius), math.cos(angle) / math.sqrt(radius), 0.0]
    return position, velocity, mass


def scene_of(position, velocity, mass):
    """The same bodies as a scene."""
    rows = zip(mass.tolist(), position.tolist(), velocity.tolist())
    return {
        "particles": [{"body": {"mass": m, "position": x, "velocity": v}} for m, x, v in rows],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {"leapfrog": {"dt": DT}},
    }


def steps_of(count):
    """Of one sample."""
    return min(MOST_STEPS, PAIRS // (count * count))


def composed(position, velocity, mass):
    """The program itself: a function that runs the steps of a sample, and one that gives the positions."""
    from mpp_taichi import Simulation

    simulation = Simulation(scene_of(position, velocity, mass), backend="cpu", precision="f64", plan="serial")
    simulation.run(steps=1)
    return lambda: simulation.launcher.advance(0.0, DT, 0, steps_of(len(mass))), lambda: simulation.snapshot().position


def hand_written(position, velocity, mass):
    """Leapfrog and gravity written out for this count: what a person would write who needs nothing else."""
    import taichi as ti

    count = len(mass)
    x, v, a = (ti.Vector.field(3, ti.f64, count, layout=ti.Layout.SOA) for _ in range(3))
    m = ti.field(ti.f64, count)
    x.from_numpy(position)
    v.from_numpy(velocity)
    m.from_numpy(mass)

    @ti.kernel
    def run(steps: ti.i32, dt: float):
        ti.loop_config(serialize=True)
        for _ in range(steps):
            for i in range(count):
                x[i] = x[i] + 0.5 * dt * v[i]
                a[i] = ti.Vector.zero(float, 3)
            for i in ti.static(range(count)):
                for j in ti.static(range(i + 1, count)):
                    d = x[j] - x[i]
                    s = 1.0 / ti.sqrt(d.dot(d))
                    w = s * s * s
                    a[i] = a[i] + (m[j] * w) * d
                    a[j] = a[j] - (m[i] * w) * d
            for i in range(count):
                v[i] = v[i] + dt * a[i]
                x[i] = x[i] + 0.5 * dt * v[i]

    run(1, DT)
    return lambda: run(steps_of(count), DT), lambda: x.to_numpy()


def rebound_leapfrog(position, velocity, mass):
    """REBOUND's leapfrog."""
    import rebound

    simulation = rebound.Simulation()
    simulation.integrator = "leapfrog"
    simulation.dt = DT
    for m, x, v in zip(mass, position, velocity):
        simulation.add(m=m, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
    simulation.steps(1)
    return lambda: simulation.steps(steps_of(len(mass))), lambda: np.array([[p.x, p.y, p.z] for p in simulation.particles])


PROGRAMS = {"composed": composed, "hand": hand_written, "rebound": rebound_leapfrog}


def measure(count, repeats):
    """Median microseconds per step of every program, interleaved, and how far their positions differ."""
    data = bodies(count)
    ready = {name: make(*data) for name, make in PROGRAMS.items() if name != "hand" or count <= LARGEST_BY_HAND}
    seconds = {name: [] for name in ready}
    for repeat in range(repeats):
        for name, (advance, _look) in ready.items():
            began = time.perf_counter()
            advance()
            seconds[name].append(time.perf_counter() - began)
        if repeat == 0:  # later, nine bodies are chaotic
            places = {name: look() for name, (_advance, look) in ready.items()}
    ratios = {name: np.median(np.array(seconds["composed"]) / times) for name, times in seconds.items()}
    return {
        "bodies": count,
        "microseconds_per_step": {name: float(np.median(times)) / steps_of(count) * 1e6 for name, times in seconds.items()},
        "ratio_to_rebound": float(ratios["rebound"]),
        "ratio_to_hand_written": float(ratios["hand"]) if "hand" in ratios else None,
        "largest_difference": float(max(np.abs(places["composed"] - p).max() for p in places.values())),
    }


def cold_start(repeats):
    """Median seconds of a process from its start to two steps, and of our own import; with and without the kernel cache."""
    code = (
        "import time, sys; t = time.perf_counter(); import taichi, numpy, yaml, pydantic, rich; u = time.perf_counter()\n"
        "import mpp_taichi; from mpp_taichi.simulation.simulation import Simulation; v = time.perf_counter()\n"
        "s = Simulation('scenes/sun_earth.yaml', backend='cpu'); s.run(steps=1); w = time.perf_counter()\n"
        "print(u - t, v - u, w - v)"
    )
    found = {}
    for label in ("cold", "warm"):
        rows = []
        with tempfile.TemporaryDirectory() as home:
            environment = dict(os.environ, HOME=home, XDG_CACHE_HOME=home)
            for _ in range(repeats + (label == "warm")):
                if label == "cold":
                    environment["HOME"] = environment["XDG_CACHE_HOME"] = tempfile.mkdtemp(dir=home)
                began = time.perf_counter()
                run = subprocess.run(
                    [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
                )
                rows.append([time.perf_counter() - began, *map(float, run.stdout.split()[-3:])])
        names = ("process", "import_libraries", "import_mpp_taichi", "scene_to_first_step")
        found[label] = dict(zip(names, np.median(rows[label == "warm" :], axis=0).tolist()))
    return found


def main():
    """Measure, print the tables, write the JSON; the exit code is 1 when the bar is not held."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS)
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    rows = [measure(count, options.repeats) for count in options.counts]
    starts = cold_start(3)
    print("leapfrog, f64, one thread: microseconds per step")
    print(f"{'bodies':>6} {'composed':>9} {'hand':>9} {'REBOUND':>9} {'÷ REBOUND':>10} {'÷ hand':>8}  difference")
    for row in rows:
        us, by_hand = row["microseconds_per_step"], row["ratio_to_hand_written"]
        print(
            f"{row['bodies']:6d} {us['composed']:9.4f} {us.get('hand', math.nan):9.4f} {us['rebound']:9.4f} "
            f"{row['ratio_to_rebound']:10.3f} {math.nan if by_hand is None else by_hand:8.3f}  {row['largest_difference']:.1e}"
        )
    for label, times in starts.items():
        print(f"{label} start of sun_earth: " + ", ".join(f"{key} {value:.2f} s" for key, value in times.items()))
    import rebound

    from mpp_taichi.device.availability import cpu_name

    verdicts = [
        (f"{row['bodies']} bodies: time ÷ REBOUND, at most", row["ratio_to_rebound"], BAR, row["ratio_to_rebound"] <= BAR)
        for row in rows
    ]
    results = {"steps": rows, "start": starts}
    return finish(verdicts, results, options.json, processor=cpu_name(), cores=os.cpu_count(), rebound=rebound.__version__)


if __name__ == "__main__":
    sys.exit(main())
