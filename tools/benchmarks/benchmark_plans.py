"""Where the parallel plan overtakes the serial one on this CPU: the measurement behind `plans.CROSSOVER_WORK`.

    python tools/benchmarks/benchmark_plans.py [--json FILE]

Leapfrog in f64 for clusters of growing size and for spring lattices; both plans in turn in one process, medians of the
repeats. `work` is the number that `plans.choose` compares; the crossover is where the ratio passes one.
"""

import argparse
import json
import os
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

GRAVITY = (32, 64, 128, 192, 256, 384, 512, 768, 1024)
LATTICES = (8, 16, 32, 48, 64, 96)


def cluster(count):
    """Bodies at random places, softened gravity."""
    places = np.random.default_rng(1).uniform(-1, 1, (count, 3))
    return {
        "particles": [{"body": {"mass": 1.0 / count, "position": place.tolist()}} for place in places],
        "forces": [{"newtonian_gravity": {"strength": 1.0, "softening": 0.05}}],
        "integrator": {"leapfrog": {"dt": 1e-4}},
    }


def lattice(side):
    """A square membrane of springs."""
    sheet = {"name": "sheet", "shape": [side, side], "lower": [-1, -1, 0], "upper": [1, 1, 0], "mass": 1.0, "fixed": "rim"}
    return {
        "particles": [{"lattice": sheet}],
        "springs": [{"lattice_links": {"of": "sheet", "stiffness": 50.0}}],
        "integrator": {"leapfrog": {"dt": 1e-3}},
    }


def measure(scene, repeats):
    """Work of a step and median microseconds per step under both plans."""
    from mpp_taichi import Simulation

    ready = {plan: Simulation(scene, backend="cpu", precision="f64", plan=plan) for plan in ("serial", "parallel")}
    seconds = {plan: [] for plan in ready}
    counts = {}
    for plan, simulation in ready.items():
        simulation.run(steps=3)
        began = time.perf_counter()
        simulation.launcher.advance(0.0, simulation.dt, 0, 20)
        counts[plan] = max(5, min(20_000, int(0.05 / max((time.perf_counter() - began) / 20, 1e-7))))
    for _ in range(repeats):
        for plan, simulation in ready.items():
            began = time.perf_counter()
            simulation.launcher.advance(0.0, simulation.dt, 0, counts[plan])
            seconds[plan].append((time.perf_counter() - began) / counts[plan])
    work = ready["serial"].phase.work
    for simulation in ready.values():
        simulation.close()
    return {"work": work} | {plan: float(np.median(times)) * 1e6 for plan, times in seconds.items()}


def main():
    """Measure, print the table, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--repeats", type=int, default=7)
    arguments = parser.parse_args()
    scenes = [("gravity", n, cluster(n)) for n in GRAVITY] + [("springs", n * n, lattice(n)) for n in LATTICES]
    rows = []
    print(f"{'scene':8} {'particles':>9} {'work':>9} {'serial µs':>10} {'parallel µs':>11} {'parallel ÷ serial':>18}")
    for kind, count, scene in scenes:
        row = {"scene": kind, "particles": count} | measure(scene, arguments.repeats)
        rows.append(row)
        ratio = row["parallel"] / row["serial"]
        print(f"{kind:8} {count:9d} {row['work']:9d} {row['serial']:10.1f} {row['parallel']:11.1f} {ratio:18.2f}")
    if arguments.json:
        from mpp_taichi.device.availability import cpu_name

        report = {"machine": cpu_name(), "cores": os.cpu_count(), "rows": rows}
        arguments.json.write_text(json.dumps(report, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
