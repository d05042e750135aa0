"""What a stiff chain costs: time to an error of 1e-3 against its analytic modes, explicit and implicit.

    python tools/benchmarks/benchmark_stiff_chain.py [--error 1e-3] [--repeats 9] [--json FILE]

Thirty-two masses on springs between two walls, hardly stretched: along the chain ω ≤ 2 √(D/m), across it
ω_k = 2 √(T/m d) sin(kπ/2(n + 1)) with a tension T so small that the largest stable step of leapfrog is a millionth of the
slowest period. The chain starts in its first two transverse modes, so faintly that they are linear, and swings for one slow
period; the error is the largest of any mass at sixteen times, over the amplitude. Explicit methods run at 0.9 of their limit,
implicit ones at the largest step, of a ladder, that keeps the error. All in f64, compiled beforehand, timed in turn; medians.
"""

import argparse
import json
import math
import os
import statistics
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

MASSES = 32
SHARE = 1e-6  # of the slowest period: the explicit limit
AMPLITUDE = (
    1e-6  # of the spacing; it lengthens the springs by 1e-14 of themselves, where the tension is 4e-9 of their stiffness
)
MODES = {1: 1.0, 2: 0.5}
LOOKS = 16
EXPLICIT = ("leapfrog",)
IMPLICIT = ("implicit_midpoint", "newmark", "energy_momentum", "bdf2", "implicit_euler")
LADDER = tuple(round(100 * 2 ** (k / 2)) for k in range(15))  # steps per slow period: 100 … 12,800


def sine(k):
    """sin(kπ/2(n + 1))."""
    return math.sin(k * math.pi / (2 * (MASSES + 1)))


# For D = m = 1 leapfrog allows 2/ω_max = 1/sin(nπ/2(n + 1)); the slowest period is π/(√τ sin(π/2(n + 1))) with τ = T/D d.
LIMIT = 1.0 / sine(MASSES)
TENSION = (SHARE * math.pi / (LIMIT * sine(1))) ** 2
PERIOD = math.pi / (math.sqrt(TENSION) * sine(1))


def chain(integrator, dt):
    """The scene, as a mapping; the walls are the first and the last mass."""
    swing = " + ".join(f"{AMPLITUDE * a!r} * sin({k} * pi * u)" for k, a in MODES.items())
    line = {
        "name": "chain",
        "shape": [MASSES + 2],
        "lower": [0, 0, 0],
        "upper": [MASSES + 1, 0, 0],
        "mass": 1.0,
        "fixed": "ends",
    }
    return {
        "title": "Stiff chain",
        "dimensions": 2,
        "particles": [{"lattice": {**line, "displacement": [0, swing, 0]}}],
        "springs": [{"lattice_links": {"of": "chain", "stiffness": 1.0, "prestretch": 1.0 / (1.0 - TENSION)}}],
        "integrator": {integrator: {"dt": dt}},
    }


def exact(at):
    """Displacements across the chain at a time."""
    place = np.arange(MASSES + 2) / (MASSES + 1)
    omega = {k: 2.0 * math.sqrt(TENSION) * sine(k) for k in MODES}
    return AMPLITUDE * sum(a * math.cos(omega[k] * at) * np.sin(k * math.pi * place) for k, a in MODES.items())


def error_of(simulation, steps):
    """Largest error over the period, with so many steps in it."""
    simulation.dt = PERIOD / steps
    simulation.restart()
    worst = 0.0
    for look in range(1, LOOKS + 1):
        simulation.run(steps=look * steps // LOOKS - simulation.step_count)
        worst = max(worst, np.abs(simulation.snapshot().position[:, 1] - exact(simulation.time)).max())
    return worst / AMPLITUDE


def seconds_of(simulation, steps):
    """Time of one period, without any look at the state on the way."""
    simulation.dt = PERIOD / steps
    simulation.restart()
    simulation.launcher.prepare(0.0, simulation.dt)
    simulation.launcher.first_bad_particle()
    began = time.perf_counter()
    simulation.launcher.advance(0.0, simulation.dt, 0, steps)
    simulation.launcher.first_bad_particle()
    return time.perf_counter() - began


def prepare(allowed):
    """(name, simulation, steps per period, error, Newton iterations a step); steps None where none keeps the error."""
    from mpp_taichi import Simulation

    ready = []
    for name in (*EXPLICIT, *IMPLICIT):
        simulation = Simulation(chain(name, LIMIT / 2.0), backend="cpu", precision="f64", plan="serial")
        if name in EXPLICIT:
            steps = math.ceil(PERIOD / (0.9 * LIMIT))
            ready.append((name, simulation, steps, error_of(simulation, steps), None))
            continue
        errors = {}
        for steps in LADDER:
            errors[steps] = error_of(simulation, steps)
            if errors[steps] <= allowed:
                break
        report = simulation.solver_report
        newton = report.newton_iterations / report.steps
        ready.append((name, simulation, steps if errors[steps] <= allowed else None, errors[steps], newton))
    return ready


def main():
    """Measure in turn, print the table, write JSON if asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--error", type=float, default=1e-3)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    ready = prepare(options.error)
    seconds = {name: [] for name, _, steps, _, _ in ready if steps}
    for _ in range(options.repeats):
        for name, simulation, steps, _, _ in ready:
            if steps:
                seconds[name].append(seconds_of(simulation, steps))
    from mpp_taichi.device.availability import cpu_name

    print(f"{cpu_name()}, {os.cpu_count()} cores; {MASSES} masses, slow period {PERIOD:.4g} = {PERIOD / LIMIT:.3g} limits\n")
    print(f"{'method':18s} {'steps':>9s} {'error':>9s} {'ms':>9s} {'/ leapfrog':>11s} {'Newton a step':>14s}")
    base = statistics.median(seconds["leapfrog"])
    rows = []
    for name, _, steps, error, newton in ready:
        if steps is None:
            print(f"{name:18s} {'':>9s} {error:9.1e}  beyond the ladder of steps")
            continue
        middle = statistics.median(seconds[name])
        rows.append(
            {"method": name, "steps": steps, "error": error, "seconds": middle, "ratio": middle / base, "newton": newton}
        )
        told = "" if newton is None else f"{newton:.2f}"
        print(f"{name:18s} {steps:9,} {error:9.1e} {1e3 * middle:9.2f} {middle / base:11.4f} {told:>14s}")
    best = min(row["ratio"] for row in rows if row["method"] in IMPLICIT)
    print(f"\nbest implicit ÷ explicit: {best:.4f} (goal: at most 0.05)")
    if options.json:
        found = {"machine": {"cpu": cpu_name(), "cores": os.cpu_count()}, "error": options.error, "rows": rows, "best": best}
        options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
