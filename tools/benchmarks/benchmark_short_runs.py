"""What a run of a few steps costs around its steps: processor time of a call of `run`, on a simulation that is compiled.

    python tools/benchmarks/benchmark_short_runs.py [--repeats 500] [--json FILE]

Kepler's problem and ten masses on springs, by leapfrog, an adaptive method, Wisdom–Holman and an implicit method. Medians of
the processor time of all threads of the process: of `run(steps=10)`, `run(until=…)`, `run(steps=10)` with a recorder that is
never due, `restart()` with `run(steps=10)`, and of the launch of ten steps alone. The bar holds for the runs without their
launch.
"""

import argparse
import math
import statistics
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout that is not installed

from verdicts import finish  # noqa: E402

STEPS = 10
WARM = 20  # calls before the first one that counts
BAR = 0.3  # milliseconds
JUDGED = ("steps", "until", "recorder")


class Never:
    """A recorder without a sample."""

    def steps_until_due(self, simulation):
        """No sample is ever due."""
        return math.inf

    def record(self, simulation):
        """Not called."""
        raise AssertionError("it is never due")


def kepler(name, dt):
    """A star and a planet."""
    star = {"mass": 1.0, "position": [0, 0, 0]}
    planet = {"mass": 1e-3, "position": [1, 0, 0], "velocity": [0, 1, 0]}
    return {
        "particles": [{"body": star}, {"body": planet}],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {name: {"dt": dt}},
    }


def chain(name, dt, count=10):
    """Masses on springs, the first one held."""
    bodies = [{"body": {"name": f"m{i}", "mass": 1.0, "position": [i, 0.01 * i * i, 0], "free": i > 0}} for i in range(count)]
    links = [{"link": {"between": [f"m{i}", f"m{i + 1}"], "stiffness": 50.0}} for i in range(count - 1)]
    return {"particles": bodies, "springs": links, "integrator": {name: {"dt": dt}}}


SCENES = {
    "Kepler, leapfrog": kepler("leapfrog", 0.01),
    "Kepler, wisdom_holman": kepler("wisdom_holman", 0.1),
    "Kepler, taylor": kepler("taylor", 0.1),
    "Kepler, ias15": kepler("ias15", 0.1),
    "springs, leapfrog": chain("leapfrog", 0.01),
    "springs, newmark": chain("newmark", 0.01),
}


def milliseconds(call, repeats):
    """Median of the processor time of a call."""
    for _ in range(WARM):
        call()
    found = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        found.append(time.process_time() - began)
    return 1e3 * statistics.median(found)


def measure(scene, repeats):
    """Milliseconds of each kind of call."""
    from mpp_taichi import Simulation

    with Simulation(scene, backend="cpu", precision="f64") as run:
        return {
            "steps": milliseconds(lambda: run.run(steps=STEPS), repeats),
            "until": milliseconds(lambda: run.run(until=run.time + STEPS * run.dt), repeats),
            "recorder": milliseconds(lambda: run.run(steps=STEPS, recorders=(Never(),)), repeats),
            "restart": milliseconds(lambda: (run.restart(), run.run(steps=STEPS)), repeats),
            "launch": milliseconds(lambda: run.launcher.advance(run.time, run.dt, 0, STEPS), repeats),
        }


def main():
    """Measure every scene; 1 where a run costs more than the bar."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=500)
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    results, verdicts = {}, []
    print(f"{'milliseconds of processor time':32}" + "".join(f"{name:>10}" for name in (*JUDGED, "restart", "launch")))
    for name, scene in SCENES.items():
        results[name] = found = measure(scene, options.repeats)
        print(f"{name:32}" + "".join(f"{value:10.3f}" for value in found.values()), flush=True)
        worst = max(found[kind] for kind in JUDGED) - found["launch"]
        verdicts.append((f"{name}: ms around the steps of a run, at most", worst, BAR, worst <= BAR))
    return finish(verdicts, results, options.json)


if __name__ == "__main__":
    raise SystemExit(main())
