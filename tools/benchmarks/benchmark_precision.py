"""What the ladder of precisions costs and what it keeps: energy floor and time of f32, f32c, ds, df64 and f64.

    python tools/benchmarks/benchmark_precision.py [--counts 3 256 4096] [--repeats 15] [--threads 2] [--json FILE]

PEFRL, whose own error is far below rounding at the finer steps; 3 bodies on the figure of eight for one period under the serial
plan, and clusters of equal masses with Gaussian places and speeds. The error is the largest |E/E₀ − 1| at eight looks, the root
mean square over four turns of the start about z, for a ladder of steps; the floor is the least of the ladder, as no step
gives less. Every precision lives in a process of its own and they take turns, so that each sample is followed by one of all
others; medians of the repeats, ratios of neighbouring samples. Times are processor time of all threads, which other programs
hardly change.

Bars: the floor of ds at least 1000 times below that of f32 on the same ladder, at most 1.8 times the time of a step.
"""

import argparse
import json
import math
import multiprocessing
import platform
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))  # so that it also runs from a checkout

PRECISIONS = ("f32", "f32c", "ds", "df64", "f64")
LADDERS = {3: (256, 1024, 4096, 16384, 65536, 262144), 256: (32, 128, 512, 2048), 4096: (16, 64, 256, 1024)}  # steps of a run
SPANS = {3: 6.3259139829262116775890, 256: 0.25, 4096: 0.25}
TURNS = {3: 4, 256: 2, 4096: 1}
LOOKS = 8
FLOOR, TIME = 1000.0, 1.8


def scene(count):
    """The figure of eight, or a cluster of `count` bodies; masses and softening are numbers that f32 has exactly."""
    if count == 3:
        v, w = 0.3471168881189269382428, 0.5327249453880302292620
        places, speeds = [[-1, 0, 0], [1, 0, 0], [0, 0, 0]], [[v, w, 0], [v, w, 0], [-2 * v, -2 * w, 0]]
        mass, softening = 1.0, 0.0
    else:
        random = np.random.default_rng(1)
        places, speeds = random.normal(0, 0.5, (count, 3)).tolist(), random.normal(0, 0.4, (count, 3)).tolist()
        mass, softening = 1.0 / count, 1 / 16
    return {
        "title": f"{count} bodies",
        "dimensions": 2 if count == 3 else 3,
        "particles": [{"body": {"mass": mass, "position": x, "velocity": v}} for x, v in zip(places, speeds)],
        "forces": [{"newtonian_gravity": {"strength": 1.0, "softening": softening}}],
        "integrator": {"pefrl": {"dt": SPANS[count] / LADDERS[count][-1]}},
    }


def energy_error(simulation, span, steps, turn):
    """The largest |E/E₀ − 1| at LOOKS looks along `span`, from the start turned about z."""
    c, s = math.cos(turn), math.sin(turn)
    matrix = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    simulation.restart()
    simulation.state.write(simulation.start.position @ matrix, simulation.start.velocity @ matrix)
    simulation.launcher.prepare(0.0, span / steps)
    first, worst = simulation.mechanics()["total_energy"], 0.0
    for _ in range(min(LOOKS, steps)):
        simulation.launcher.advance(0.0, span / steps, 0, steps // min(LOOKS, steps))
        worst = max(worst, abs(simulation.mechanics()["total_energy"] / first - 1))
    return worst


def work(pipe, count, precision, threads):
    """Hold one simulation and do as the parent says: errors for a number of steps, or seconds per step."""
    from mpp_taichi import Simulation
    from mpp_taichi.device.backends import import_taichi

    with Simulation(scene(count), backend="cpu", precision=precision, threads=threads) as simulation:
        synchronise, dt = import_taichi().sync, simulation.dt
        simulation.run(steps=2)
        pipe.send((simulation.plan, simulation.device.name))
        while (steps := pipe.recv()) is not None:
            if steps > 0:
                turns = [0.3 + 0.37 * k for k in range(TURNS[count])]
                errors = [energy_error(simulation, SPANS[count], steps, turn) for turn in turns]
                pipe.send(float(np.sqrt(np.mean(np.square(errors)))))
            else:
                simulation.restart()
                simulation.launcher.prepare(0.0, dt)
                simulation.launcher.advance(0.0, dt, 0, 1)
                synchronise()
                began = time.process_time()
                simulation.launcher.advance(0.0, dt, 0, -steps)
                synchronise()
                pipe.send((time.process_time() - began) / -steps)


def benchmark(count, repeats, threads):
    """Errors by steps, floor, seconds per step and their ratio to f32, for every precision."""
    context = multiprocessing.get_context("spawn")  # Taichi does not survive a fork
    ends, children = {}, []
    for precision in PRECISIONS:
        ends[precision], theirs = context.Pipe()
        children.append(context.Process(target=work, args=(theirs, count, precision, threads), daemon=True))
        children[-1].start()
        plan, device = ends[precision].recv()
    seconds, rows = {precision: [] for precision in PRECISIONS}, {precision: {} for precision in PRECISIONS}

    def ask(precision, what):
        ends[precision].send(what)
        return ends[precision].recv()

    for precision in PRECISIONS:
        rows[precision]["errors"] = {steps: ask(precision, steps) for steps in LADDERS[count]}
        rows[precision]["floor"] = min(rows[precision]["errors"].values())
    loop = max(2, int(0.05 / ask("f32", -2)))
    for repeat in range(repeats):
        turn = repeat % len(PRECISIONS)
        for precision in PRECISIONS[turn:] + PRECISIONS[:turn]:
            seconds[precision].append(ask(precision, -loop))
    for precision, times in seconds.items():
        low, median, high = np.percentile(times, [25, 50, 75])
        rows[precision] |= {
            "seconds": median,
            "quartiles": [low, high],
            "fastest": min(times),
            "time_ratio": float(np.median(np.divide(times, seconds["f32"]))),
            "time_ratio_of_fastest": min(times) / min(seconds["f32"]),
            "floor_ratio": rows["f32"]["floor"] / rows[precision]["floor"],
            "error_ratio": {steps: rows["f32"]["errors"][steps] / error for steps, error in rows[precision]["errors"].items()},
        }
        ends[precision].send(None)
    for child in children:
        child.join()
    return {"count": count, "plan": plan, "device": device, "rows": rows}


def show(case):
    """The table of a scene."""
    ladder = LADDERS[case["count"]]
    print(f"\n{case['count']} bodies, {case['plan']} plan, t = {SPANS[case['count']]:.4g}; energy error by steps")
    print(
        f"{'':5s}" + "".join(f"{steps:>10,d}" for steps in ladder) + f"{'floor':>10s}{'f32/it':>9s}{'step':>11s}{'× f32':>7s}"
    )
    for precision, row in case["rows"].items():
        errors = "".join(f"{row['errors'][steps]:10.1e}" for steps in ladder)
        timing = f"{row['seconds'] * 1e6:12,.4g}{row['time_ratio']:7.2f}"
        print(f"{precision:5s}{errors}{row['floor']:10.1e}{row['floor_ratio']:9.2g}{timing}")


def main():
    """Measure, print, write, and fail where a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--counts", type=int, nargs="+", default=list(LADDERS), choices=list(LADDERS))
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    results = []
    for count in arguments.counts:
        results.append(benchmark(count, arguments.repeats, arguments.threads))
        show(results[-1])
    print()
    missed = 0
    for case in results:
        row = case["rows"]["ds"]
        for text, value, bar, held in (
            ("floor of f32 over that of ds, at least", row["floor_ratio"], FLOOR, row["floor_ratio"] >= FLOOR),
            ("time of ds over that of f32, at most", row["time_ratio"], TIME, row["time_ratio"] <= TIME),
        ):
            missed += not held
            print(f"{'held  ' if held else 'MISSED'} {case['count']} bodies: {text} {bar:g}: {value:.3g}")
    if arguments.json:
        found = {"machine": platform.machine(), "python": platform.python_version(), "results": results}
        arguments.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 4 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
