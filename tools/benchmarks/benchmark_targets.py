"""`accuracy: 1e-k` on six scenes: the error that is delivered, and what it costs beside the fastest run of a whole sweep.

    python tools/benchmarks/benchmark_targets.py [--scenes kepler,membrane] [--digits 3-12] [--budget 120] [--pilot 30]
        [--json FILE]

For every scene and k the pilot of `accuracy:` makes a choice in f64 or f32. What it delivers is measured with a run of the
scene with that choice against a reference that shares no code with the program: NumPy in long double (18 digits), extrapolated
midpoint steps (Gragg, Bulirsch, Stoer; Hairer, Nørsett & Wanner, Solving ODEs I, II.9). The sweep is that of the verb
`accuracy` with `--budget`; of its runs the fastest within the target counts. Both are timed again, in turns: the ratio of the
medians is the price of choosing.
"""

import argparse
import json
import statistics
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that it also runs from a checkout

from mpp_taichi import __version__
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import choose
from mpp_taichi.accuracy.methods import LOOKS
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.sample import Configuration
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.errors import StabilityError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.simulation.simulation import Simulation

FOLDER = Path(__file__).parents[2] / "scenes"
# Each over a span in which positions mean something to the last digit asked for.
SCENES = {
    "kepler": {},
    "figure_eight": {},
    "outer_solar_system": {},
    "double_pendulum": {"run.duration": 5.0},
    "membrane": {"run.duration": 5.0},
    "cluster": {"run.duration": 1.0},
}
LONGEST_EXTRAPOLATION = 12
REPEATS = 5


def accelerations(spec, start):
    """a(x) of gravity, springs and a uniform field, in long double, from the text of the scene alone."""
    mass, free = start.mass.astype(np.longdouble), start.free.astype(np.longdouble)
    gravity, field = None, np.zeros(3, np.longdouble)
    for force in spec.forces:
        if force.name == "newtonian_gravity":
            gravity = np.longdouble(force.parameters["strength"]), np.longdouble(force.parameters.get("softening") or 0.0)
        elif force.name == "uniform_gravity":
            field += np.array(force.parameters["acceleration"], np.longdouble)
        else:
            raise SystemExit(f"the reference knows no {force.name}")
    springs = start.springs
    one, other = springs.between.T if len(springs) else (np.empty(0, int), np.empty(0, int))

    def of(x):
        a = np.tile(field, (len(mass), 1))
        if gravity is not None:
            d = x[None, :, :] - x[:, None, :]
            squared = (d * d).sum(-1) + gravity[1] ** 2
            np.fill_diagonal(squared, 1)
            a += gravity[0] * np.einsum("ij,ijk->ik", mass[None, :] / (squared * np.sqrt(squared)), d)
        if len(one):
            d = x[other] - x[one]
            length = np.sqrt((d * d).sum(-1))
            pull = (springs.stiffness * (length - springs.rest_length) / length)[:, None] * d
            np.add.at(a, one, pull / mass[one, None])
            np.add.at(a, other, -pull / mass[other, None])
        return a * free

    return of


def reference_end(spec, start, span):
    """Positions at the end: Gragg's midpoint steps for x'' = a(x), extrapolated to order 24, with steps to match."""
    of, tolerance = accelerations(spec, start), np.longdouble(1e-17)
    x, v = start.position.astype(np.longdouble), start.velocity.astype(np.longdouble)
    span = np.longdouble(span)
    t, h = np.longdouble(0), span / 64
    while t < span:
        h = min(h, span - t)
        table, a0 = [], of(x)
        for k in range(LONGEST_EXTRAPOLATION):
            n = 2 * (k + 1)
            g, w, place = h / n, v + h / (2 * n) * a0, x
            for _ in range(n - 1):  # Störmer's rule: leapfrog, whose error has even powers of g alone
                place = place + g * w
                w = w + g * of(place)
            place = place + g * w
            row = [np.stack([place, w + g / 2 * of(place)])]
            for j in range(k):
                ratio = (np.longdouble(n) / (2 * (k - j))) ** 2
                row.append(row[j] + (row[j] - table[j]) / (ratio - 1))
            if k > 1:
                size = np.abs(row[-1]).max(axis=(1, 2), keepdims=True)
                error = (np.abs(row[-1] - row[-2]) / size).max() / tolerance
                if error <= 1:
                    break
            table = row
        if error <= 1:
            t, (x, v) = t + h, row[-1]
            h *= 1.5 if k < LONGEST_EXTRAPOLATION - 3 else 1.0
        else:
            h /= 2
    return x


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


def timed(problem, configurations):
    """Median seconds of each configuration, by key, in turns."""
    seconds = {configuration.key: [] for configuration in configurations}
    for precision in sorted({each.precision for each in configurations}):
        with Workbench(problem, backend="cpu", precision=precision) as bench:
            for _ in range(REPEATS):
                for each in configurations:
                    if each.precision == precision:
                        seconds[each.key].append(bench.machine(each.integrator).time(each, Budget(600.0)))
    return {key: statistics.median(found) for key, found in seconds.items()}


def measure(name, digits, budget, pilot, folder):
    """Rows of one scene."""
    changes = SCENES[name]
    plain = load_scene(FOLDER / f"{name}.yaml", overrides=changes)
    study = sweep(plain, folder / "sweep", budget)
    if study.quantity != "position" or study.problem.span != study.whole:
        print(f"{name}: not the positions at the end of the whole run were compared")
    start, size = study.problem.start, study.reference.size
    end = reference_end(plain, start, study.problem.span)
    rows, configurations = [], []
    for k in digits:
        spec = load_scene(FOLDER / f"{name}.yaml", overrides={**changes, "accuracy": 10.0**-k})
        row = {"scene": name, "target": 10.0**-k, "reference": float(study.reference.bar)}
        reached = [r for r in study.rows() if r.sample.status == "ok" and r.seconds and r.error("position").bound <= 10.0**-k]
        best = min(reached, key=lambda r: r.seconds, default=None)
        if best is not None:
            configurations.append(best.sample.configuration)
            row["fastest"] = best.sample.configuration.key
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
        print(json.dumps(row), flush=True)
    seconds = timed(study.problem, list(dict.fromkeys(configurations)))
    for row in rows:
        row["seconds"], row["fastest_seconds"] = (seconds.get(row.get(key)) for key in ("chosen", "fastest"))
    return rows


def show(rows):
    """The table."""
    print("scene                target   error    chosen                                   time/fastest of the sweep")
    for row in rows:
        ratio = row["seconds"] / row["fastest_seconds"] if row.get("seconds") and row.get("fastest_seconds") else float("nan")
        chosen = row["chosen"] if "chosen" in row else row["refused"].split(": ", 2)[-1][:40]
        fastest = row.get("fastest", "none")
        print(f"{row['scene']:<20} {row['target']:<8.0e} {row.get('error', np.nan):<8.1e} {chosen:<40} {ratio:<6.2f} {fastest}")


def main():
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--digits", default="3-12")
    parser.add_argument("--budget", type=float, default=120.0, help="seconds of the sweep")
    parser.add_argument("--pilot", type=float, default=30.0, help="seconds of each choice")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    first, last = map(int, arguments.digits.split("-"))
    rows = []
    for name in arguments.scenes.split(","):
        with tempfile.TemporaryDirectory() as folder:
            rows += measure(name, range(first, last + 1), arguments.budget, arguments.pilot, Path(folder))
    show(rows)
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
