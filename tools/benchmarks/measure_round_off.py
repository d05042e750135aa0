"""What rounding and softening cost in accuracy, and what it costs in time to be rid of them.

    python tools/benchmarks/measure_round_off.py [--panels summation,origin,softening] [--repeats 7] [--json FILE] [--html FILE]

summation  accelerations of N bodies in every precision, against the sum in long double of the same rounded positions
origin     the figure eight shifted from the origin by D times its size, one period in every precision, against f64 at D = 0
softening  a cluster of 64 bodies with gravity softened by ε, each ε integrated to 1e-8 a step, against IAS15 without softening

Errors are the largest of a body, relative to the largest acceleration or to the size of the system; times are medians of the
stepping alone. The HTML page has a plot for each: error on one axis, time (or the distance) on the other.
"""

import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that it also runs from a checkout

from mpp_taichi import Simulation
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.precision import PRECISIONS
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

FIGURE_EIGHT = Path(__file__).parents[2] / "scenes" / "figure_eight.yaml"
COUNTS = (64, 256, 1024, 4096)
DISTANCES = (0.0, 1.0, 1e2, 1e4, 1e6)
STEPS = 1000  # of a period
SOFTENINGS = (0.2, 0.1, 0.05, 0.025, 0.0125)


def bodies(position, velocity, mass):
    """The `particles:` of a scene."""
    rows = zip(position.tolist(), velocity.tolist(), mass.tolist())
    return [{"body": {"mass": m, "position": x, "velocity": v}} for x, v, m in rows]


def timed(work, repeats):
    """Median seconds of a call, after one to warm up."""
    ti = import_taichi()
    seconds = []
    for _ in range(repeats + 1):
        ti.sync()
        began = time.perf_counter()
        work()
        ti.sync()
        seconds.append(time.perf_counter() - began)
    return statistics.median(seconds[1:])


def exact_sum(x, mass):
    """Accelerations with G = 1, in long double."""
    result = np.zeros(x.shape, np.longdouble)
    for i, place in enumerate(x):
        d = x - place
        squared = (d * d).sum(1)
        squared[i] = 1
        result[i] = (mass / (squared * np.sqrt(squared)))[:, None].T @ d
    return result


def summation(repeats):
    """Rows of precision, count, error and seconds of a sum."""
    random, rows = np.random.default_rng(1), []
    for count in COUNTS:
        x = random.normal(size=(count, 3)).astype(np.float32).astype(np.longdouble)  # the same numbers in every precision
        mass = np.full(count, 2.0**-12, np.longdouble)
        truth = exact_sum(x, mass)
        scene = {
            "particles": bodies(x.astype(float), np.zeros((count, 3)), mass.astype(float)),
            "forces": [{"newtonian_gravity": {"strength": 1.0}}],
            "integrator": {"velocity_verlet": {"dt": 1e-3}},
        }
        for precision in PRECISIONS:
            with Simulation(scene, backend="cpu", precision=precision, plan="parallel") as simulation:
                seconds = timed(lambda sim=simulation: sim.launcher.prepare(0.0, sim.dt), repeats)
                found = simulation.state.acceleration.to_numpy()
            error = (
                np.linalg.norm((found - truth).astype(float), axis=1).max() / np.linalg.norm(truth.astype(float), axis=1).max()
            )
            rows.append({"series": precision, "x": seconds, "error": float(error), "said": f"{precision}, N = {count:,}"})
    return rows


def origin(repeats):
    """Rows of precision, distance, error and seconds of a period."""
    spec = load_scene(FIGURE_EIGHT)
    start = assemble(spec)
    size = float(np.sqrt(np.mean(np.sum(start.position**2, axis=1))))
    period, rows, truth = float(spec.run.duration), [], None
    for precision in reversed(PRECISIONS):
        for distance in DISTANCES:
            shift = np.array([distance * size, 0.0, 0.0])
            scene = {
                "dimensions": 2,
                "particles": bodies((start.position + shift)[:, :2], start.velocity[:, :2], start.mass),
                "forces": [{"newtonian_gravity": {"strength": 1.0}}],
                "integrator": {"pefrl": {"dt": period / STEPS}},
            }
            with Simulation(scene, backend="cpu", precision=precision) as simulation:
                mark = simulation.mark()

                def go(sim=simulation, back=mark):
                    sim.return_to(back)
                    sim.try_steps(STEPS)

                seconds = timed(go, repeats)
                # A shift is rounded itself: what counts is the motion, seen from where it began.
                position = simulation.snapshot().position
            found = position - position.mean(axis=0)
            if truth is None:
                truth = found
                continue
            error = float(np.linalg.norm(found - truth, axis=1).max() / size)
            said = f"{precision}, D = {distance:g}"
            rows.append({"series": precision, "x": max(distance, 0.1), "error": error, "seconds": seconds, "said": said})
    return rows


def softening(repeats):
    """Rows of softening, error and seconds."""
    plummer = {"particles": [{"plummer": {"count": 64}}], "seed": 5, "run": {"duration": 1.0}}
    rows, truth = [], None
    for epsilon in (0.0, *sorted(SOFTENINGS)):
        method = {"ias15": {"dt": 0.5}} if epsilon == 0.0 else {"adaptive_dop853": {"dt": 0.5, "tolerance": 1e-8}}
        gravity = {"newtonian_gravity": {"strength": 1.0, "softening": epsilon}}
        with Simulation({**plummer, "forces": [gravity], "integrator": method}, backend="cpu", precision="f64") as simulation:
            mark = simulation.mark()

            def go(sim=simulation, back=mark):
                sim.return_to(back)
                sim.try_steps(2)

            seconds = timed(go, repeats)
            found = simulation.snapshot().position
        if truth is None:
            truth, size = found, float(np.sqrt(np.mean(np.sum((found - found.mean(axis=0)) ** 2, axis=1))))
            continue
        apart = np.linalg.norm(found - truth, axis=1) / size
        rows.append({"series": "largest", "x": seconds, "error": float(apart.max()), "said": f"ε = {epsilon:g}"})
        rows.append({"series": "median", "x": seconds, "error": float(np.median(apart)), "said": f"ε = {epsilon:g}"})
    return rows


PANELS = {
    "summation": (summation, "Sum of the forces of 64 … 4,096 bodies", "time of a sum [s]", "error of an acceleration"),
    "origin": (
        origin,
        "Figure eight, away from the origin",
        "distance, in sizes of the system (0.1: none)",
        "error of a position",
    ),
    "softening": (softening, "Cluster of 64 bodies, ε = 0.2 … 0.0125", "time of the run [s]", "error of a position"),
}


def page(results):
    """One HTML page of plots, by the report's own drawing."""
    from mpp_taichi.accuracy.report import style_sheet
    from mpp_taichi.accuracy.svg import Plot, PlotMark, Series, draw, marker

    parts = [f"<!doctype html><meta charset='utf-8'><title>Round-off</title><style>{style_sheet()}</style>"]
    for panel, rows in results.items():
        _, title, x_label, y_label = PANELS[panel]
        names = list(dict.fromkeys(row["series"] for row in rows))
        series = []
        for k, name in enumerate(names):
            mine = [row for row in rows if row["series"] == name]
            marks = [PlotMark(row["x"], row["error"], f"{row['said']}: {row['error']:.1e}") for row in mine]
            series.append(Series(name, k, marks))
        keys = "".join(f'<li><svg viewBox="0 0 26 14">{marker(k, 13, 7)}</svg>{name}</li>' for k, name in enumerate(names))
        parts.append(f"<h2>{title}</h2><ul class='legend'>{keys}</ul>{draw(Plot(title, x_label, y_label, series))}")
    return "\n".join(parts)


def main():
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--panels", default=",".join(PANELS))
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--html", type=Path)
    arguments = parser.parse_args()
    results = {}
    for panel in arguments.panels.split(","):
        results[panel] = PANELS[panel][0](arguments.repeats)
        print(f"\n{PANELS[panel][1]}")
        for row in results[panel]:
            print(
                f"  {row['series']:<8} {row['said']:<22} error {row['error']:.1e}  {1e3 * row.get('seconds', row['x']):9.3f} ms"
            )
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1), encoding="utf-8")
    if arguments.html:
        arguments.html.write_text(page(results), encoding="utf-8")


if __name__ == "__main__":
    main()
