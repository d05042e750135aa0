"""The time of the energy of N bodies beside a step of their leapfrog, which is one evaluation of the force.

    python tools/benchmarks/benchmark_energy.py [--counts 301 3073 16384] [--repeats 9] [--json FILE]

A Plummer sphere under gravity on the CPU. Both are timed in turns in one process, by the wall clock; medians of the repeats.
The energy is summed in f64 in every precision, in f32 over distances of f32. The bar: an energy takes no longer than a step.
"""

import argparse
import statistics
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout

from verdicts import finish  # noqa: E402

STEPS = 5


def measured(count, precision, repeats):
    """Median seconds of an energy and of a step."""
    from mpp_taichi import Simulation

    scene = {
        "particles": [{"plummer": {"count": count}}],
        "forces": [{"newtonian_gravity": {"softening": 0.01}}],
        "integrator": {"leapfrog": {"dt": 1e-4}},
    }
    energies, steps = [], []
    with Simulation(scene, backend="cpu", precision=precision) as run:
        meter = run.phase.energy_meter
        meter.potential_energy(0.0)
        run.run(steps=STEPS)
        for _ in range(repeats):
            began = time.perf_counter()
            meter.potential_energy(0.0)
            energies.append(time.perf_counter() - began)
            began = time.perf_counter()
            run.try_steps(STEPS, judged=False)
            steps.append((time.perf_counter() - began) / STEPS)
        name = run.device.name
    return statistics.median(energies), statistics.median(steps), name


def main():
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--counts", type=int, nargs="+", default=[301, 3073, 16384])
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    results, verdicts, name = {}, [], ""
    print(f"{'bodies':>10} {'precision':>10} {'energy [ms]':>12} {'step [ms]':>10} {'energy / step':>14}")
    for count in options.counts:
        for precision in ("f64", "f32"):
            energy, step, name = measured(count, precision, options.repeats)
            results[f"{count} {precision}"] = {"energy_seconds": energy, "step_seconds": step}
            print(f"{count:>10,} {precision:>10} {1e3 * energy:>12.3f} {1e3 * step:>10.3f} {energy / step:>14.2f}")
            if count >= 1000:
                verdicts.append((f"{count:,} bodies, {precision}: energy ÷ step, at most", energy / step, 1.0, energy <= step))
    return finish(verdicts, results, options.json, processor=name)


if __name__ == "__main__":
    sys.exit(main())
