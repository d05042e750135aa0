"""wisdom_holman beside REBOUND's WHFast on the outer solar system: time of a step, and how the energy errs.

    python tools/benchmarks/benchmark_planetary.py [--steps 20000] [--repeats 15] [--seconds 20] [--json FILE]

Both take the same steps in Jacobi's coordinates, unsynchronised between looks. Times are those of one thread each,
interleaved, by the processor's clock, without compilation, for each corrector the median of the ratios. Energies are summed in
long double; the error is the largest at looks over a run of so many seconds, 40 looks in all. A bar is said to hold or not.
"""

import argparse
import json
import os
import platform
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]  # so that it also runs from a checkout

from benchmark_adaptive import energy, rebound_energy, rebound_system, scene  # noqa: E402

STEPS = (50.0, 175.0, 350.0)  # days: 87, 25 and 12 to Jupiter's year
CORRECTORS = (0, 11)
LOOKS = 40
BAR = 1.0  # time over WHFast's


def ours(step, corrector):
    """Our run."""
    from mpp_taichi import Simulation

    made = {**scene(step), "integrator": {"wisdom_holman": {"dt": step, "corrector": corrector}}}
    return Simulation(made, backend="cpu", precision="f64", plan="serial")


def theirs(step, corrector):
    """REBOUND's."""
    simulation = rebound_system()
    simulation.integrator, simulation.dt = "whfast", step
    simulation.integrator.safe_mode, simulation.integrator.corrector = 0, corrector
    return simulation


def measure(step, corrector, steps, repeats, seconds):
    """One row: µs of a step of both, their ratio, and the largest errors of the energy."""
    other = theirs(step, corrector)
    with ours(step, corrector) as run:
        first, other_first = energy(*run.state.read()), rebound_energy(other)
        mark = run.mark()
        run.run(steps=1)  # compiles
        run.return_to(mark)
        times = {"ours": [], "rebound": []}
        for _ in range(repeats):
            began = time.process_time()
            run.try_steps(steps)
            times["ours"].append(time.process_time() - began)
            began = time.process_time()
            other.steps(steps)
            other.synchronize()
            times["rebound"].append(time.process_time() - began)
        spent = float(np.median(times["ours"]) + np.median(times["rebound"])) / steps
        count, errors, other_errors = max(1, round(seconds / spent / LOOKS)), [], []
        for _ in range(LOOKS):
            run.try_steps(count)
            other.steps(count)
            other.synchronize()
            errors.append(abs(float(energy(*run.state.read()) / first - 1)))
            other_errors.append(abs(float(rebound_energy(other) / other_first - 1)))
    return {
        "step": step,
        "corrector": corrector,
        "microseconds": {name: 1e6 * float(np.median(each)) / steps for name, each in times.items()},
        "ratio": float(np.median(np.divide(times["ours"], times["rebound"]))),
        "years": (repeats * steps + LOOKS * count) * step / 365.25,
        "energy_error": {"ours": max(errors), "rebound": max(other_errors)},
    }


def main():
    """Run, print, write; exit code 1 when a bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    from mpp_taichi.device import backends

    backends.start("cpu", "f64", threads=1)
    rows = []
    print(
        f"{'days':>6}{'corrector':>11}{'µs a step':>11}{'WHFast':>8}{'ratio':>7}{'years':>12}{'energy error':>14}{'WHFast':>9}"
    )
    for step in STEPS:
        for corrector in CORRECTORS:
            share = options.seconds / len(STEPS) / len(CORRECTORS)
            row = measure(step, corrector, options.steps, options.repeats, share)
            rows.append(row)
            took, error = row["microseconds"], row["energy_error"]
            print(f"{step:6g}{corrector:11}{took['ours']:11.3f}{took['rebound']:8.3f}{row['ratio']:7.2f}{row['years']:12,.0f}"
                  f"{error['ours']:14.1e}{error['rebound']:9.1e}", flush=True)  # fmt: skip
    ratio = float(np.median([row["ratio"] for row in rows]))
    print(f"\n{'ok  ' if ratio <= BAR else 'FAIL'} time over WHFast's, at most {BAR:g}: {ratio:.2f}")
    if options.json:
        machine = {
            "processor": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "system": platform.platform(),
        }
        options.json.write_text(json.dumps({"machine": machine, "rows": rows, "ratio": ratio}, indent=1), encoding="utf-8")
    return 0 if ratio <= BAR else 1


if __name__ == "__main__":
    sys.exit(main())
