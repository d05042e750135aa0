"""`accuracy: 1e-k` on many scenes: the error that is delivered, and what it costs beside the best setting by brute force.

    python tools/benchmarks/benchmark_targets.py [--scenes kepler,membrane] [--digits 3,6,9] [--budget 120] [--pilot 20]
        [--json FILE]

For every scene and k the pilot of `accuracy:` makes a choice in f64 or f32. What it delivers is measured with a run of the
scene with that choice against a reference that shares no code with the program (long_double_reference.py). The best setting
is found by brute force: a sweep of the verb `accuracy` with `--budget` over all methods, and then, for every method that may be
the fastest, runs with BETWEEN more steps (or tolerances) between its last run with a larger true error than the target and its
first run with a smaller one. The fastest FINALISTS within the target and the choice are timed again, in turns: the ratio of
the shortest times is the price of choosing. The scenes are twelve bundled scenes and those of target_scenes/.
For every run of the sweep of which a number is told as its error the table also has the extremes of told over true error.
"""

import argparse
import json
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]  # so that it also runs from a checkout

from long_double_reference import reference_end  # noqa: E402

from mpp_taichi import __version__  # noqa: E402
from mpp_taichi.accuracy.budget import Budget  # noqa: E402
from mpp_taichi.accuracy.choice import choose  # noqa: E402
from mpp_taichi.accuracy.methods import LOOKS  # noqa: E402
from mpp_taichi.accuracy.problem import pose  # noqa: E402
from mpp_taichi.accuracy.sample import Configuration  # noqa: E402
from mpp_taichi.accuracy.store import Store, identity  # noqa: E402
from mpp_taichi.accuracy.study import Study, StudyWishes  # noqa: E402
from mpp_taichi.accuracy.workbench import Workbench  # noqa: E402
from mpp_taichi.errors import StabilityError  # noqa: E402
from mpp_taichi.scene.load import load_scene  # noqa: E402
from mpp_taichi.simulation.simulation import Simulation  # noqa: E402

BUNDLED, OWN = Path(__file__).parents[2] / "scenes", Path(__file__).with_name("target_scenes")
# Each over a span in which positions mean something to the last digit asked for.
SCENES = {
    "kepler": {},
    "figure_eight": {},
    "outer_solar_system": {},
    "double_pendulum": {"run.duration": 5.0},
    "membrane": {"run.duration": 5.0},
    "cluster": {"run.duration": 1.0},
    "sun_earth": {},
    "kepler16": {},
    "solar_system": {"run.duration": 730.0},
    "butterfly": {},
    "chain": {"run.duration": 5.0},
    "driven_oscillator": {"run.duration": 40.0},
    **{path.stem: {} for path in sorted(OWN.glob("*.yaml"))},
}
REPEATS = 9
BETWEEN = 5
FINALISTS = 4
PROMISING = 4.0  # times the time of the fastest run within the target: methods with slower runs cannot be the fastest


def sweep(spec, folder, budget):
    """Everything that the verb finds."""
    problem = pose(spec)
    study = Study(problem, Store(folder, identity(problem, problem.span, __version__)), Budget(budget), StudyWishes())
    study.run()
    return study


def delivered(spec, found, end, size):
    """Error of a run of the scene with the choice."""
    with Simulation(found.settle(spec), backend="cpu", precision=found.precision) as simulation:
        simulation.run()
        return float(np.linalg.norm((simulation.snapshot().position - end).astype(float), axis=1).max() / size)


def true_error(sample, end, size):
    """The largest error of a particle at the end of a run, against the reference of this tool."""
    if sample.status != "ok" or sample.end is None:
        return math.inf
    return float(np.linalg.norm((sample.end - end).astype(float), axis=1).max() / size)


def finalists(study, end, target):
    """The fastest settings within a target: (seconds, configuration), the coarsest of each method that was found."""
    size, methods = study.reference.size, {}
    for row in study.rows():
        configuration = row.sample.configuration
        if (
            row.sample.status == "ok"
            and configuration.backend == "cpu"
            and row.seconds
            and configuration.integrator in study.methods
        ):
            methods.setdefault((configuration.precision, configuration.integrator), []).append(row)
    first = {}
    for key, rows in methods.items():
        rows.sort(key=lambda row: row.sample.configuration.fineness)
        within = [true_error(row.sample, end, size) <= target for row in rows]
        if any(within):
            number = within.index(True)
            first[key] = rows[number], rows[number - 1] if number else None
    fastest = min((row.seconds for row, _ in first.values()), default=math.inf)
    found = []
    for precision in sorted({precision for precision, _ in first}):
        with Workbench(study.problem, backend="cpu", precision=precision) as bench:
            for (its_precision, name), (row, coarser) in first.items():
                if its_precision == precision and row.seconds <= PROMISING * fastest:
                    made = row.sample.configuration
                    found.append((row.seconds, made))
                    if coarser is not None:
                        found += between(
                            bench.machine(name),
                            coarser.sample.configuration,
                            made,
                            lambda s: true_error(s, end, size) <= target,
                        )
    return sorted(found, key=lambda each: each[0])[:FINALISTS]


def between(machine, coarser, finer, is_within):
    """The coarsest of BETWEEN settings between two that is within the target, as a list of at most one."""
    for share in range(1, BETWEEN + 1):
        fineness = coarser.fineness * (finer.fineness / coarser.fineness) ** (share / (BETWEEN + 1))
        setting = (finer.steps, 1.0 / fineness) if finer.tolerance is not None else (round(fineness), None)
        configuration = machine.configuration(*setting)
        if is_within(machine.run(configuration, Budget(600.0))[0]):
            return [(machine.time(configuration, Budget(600.0)), configuration)]
    return []


def told_over_true(study, end):
    """The smallest and the largest ratio of the error that is told to the true error, over the runs with a number."""
    found = []
    for row in study.rows():
        if row.position.value is not None and row.sample.end is not None:
            true = true_error(row.sample, end, study.reference.size)
            found.append(row.position.value / true)
    return [min(found), max(found)] if found else None


def timed(problem, configurations):
    """The shortest seconds of each configuration, by key, in turns."""
    seconds = {configuration.key: [] for configuration in configurations}
    for precision in sorted({each.precision for each in configurations}):
        with Workbench(problem, backend="cpu", precision=precision) as bench:
            for _ in range(REPEATS):
                for each in configurations:
                    if each.precision == precision:
                        seconds[each.key].append(bench.machine(each.integrator).time(each, Budget(600.0)))
    return {key: min(found) for key, found in seconds.items()}


def measure(name, digits, budget, pilot, folder):
    """Rows of one scene."""
    changes = SCENES[name]
    path = next(path for folder in (OWN, BUNDLED) if (path := folder / f"{name}.yaml").is_file())
    plain = load_scene(path, overrides=changes)
    study = sweep(plain, folder / "sweep", budget)
    if study.quantity != "position" or study.problem.span != study.whole:
        print(f"{name}: not the positions at the end of the whole run were compared")
    start, size = study.problem.start, study.reference.size
    end = reference_end(plain, start, study.problem.span)
    told = told_over_true(study, end)
    rows, configurations = [], []
    for k in digits:
        spec = load_scene(path, overrides={**changes, "accuracy": 10.0**-k})
        row = {"scene": name, "target": 10.0**-k, "reference": float(study.reference.bar), "told_over_true": told}
        best = [configuration for _, configuration in finalists(study, end, 10.0**-k)]
        configurations += best
        row["finalists"] = [configuration.key for configuration in best]
        try:
            found = choose(spec, folder / f"choice-{k}", seconds=pilot)
        except StabilityError as error:
            row["refused"] = str(error)
        else:
            steps = LOOKS if found.tolerance is not None else round(study.problem.span / found.dt)
            chosen = Configuration(found.integrator, steps, found.precision, "cpu", found.control, found.tolerance)
            configurations.append(chosen)
            row["chosen"] = chosen.key
            row["error"] = delivered(spec, found, end, size)
        rows.append(row)
    seconds = timed(study.problem, list(dict.fromkeys(configurations)))
    for row in rows:
        row["fastest"] = min(row["finalists"], key=seconds.__getitem__, default=None)
        row["seconds"], row["fastest_seconds"] = (seconds.get(row.get(key)) for key in ("chosen", "fastest"))
        if row["seconds"] and row["fastest_seconds"]:
            row["ratio"] = row["seconds"] / row["fastest_seconds"]
        print(json.dumps(row), flush=True)
    return rows


def show(rows):
    """The table."""
    print(
        "scene                target   error    chosen                                   time over the time of the best setting"
    )
    for row in rows:
        ratio = row["seconds"] / row["fastest_seconds"] if row.get("seconds") and row.get("fastest_seconds") else float("nan")
        chosen = row["chosen"] if "chosen" in row else row["refused"].split(": ", 2)[-1][:40]
        fastest = row["fastest"] or "none"
        print(f"{row['scene']:<20} {row['target']:<8.0e} {row.get('error', np.nan):<8.1e} {chosen:<40} {ratio:<6.2f} {fastest}")
    print("\nscene                smallest and largest error told / true error")
    for name, told in {row["scene"]: row["told_over_true"] for row in rows}.items():
        print(f"{name:<20} {'no number was told' if told is None else '{:.3f} {:.3f}'.format(*told)}")


def main():
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--digits", default="3,6,9", help="k of the targets 10^-k: 3,6,9 or 3-12")
    parser.add_argument("--budget", type=float, default=120.0, help="seconds of processor time of the sweep")
    parser.add_argument("--pilot", type=float, default=20.0, help="seconds of processor time of each choice")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    first, dash, last = arguments.digits.partition("-")
    digits = range(int(first), int(last) + 1) if dash else [int(k) for k in arguments.digits.split(",")]
    rows = []
    for name in arguments.scenes.split(","):
        with tempfile.TemporaryDirectory() as folder:
            rows += measure(name, digits, arguments.budget, arguments.pilot, Path(folder))
    show(rows)
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
