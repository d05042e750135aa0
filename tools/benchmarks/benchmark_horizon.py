"""`horizon: true` on many scenes: the time that is told beside the true time, and what the search costs.

    python tools/benchmarks/benchmark_horizon.py [--scenes kepler_long,ions] [--share 0.02] [--least WORK] [--repeats 0]

The true time is the first of 800 evenly spaced times at which a run of the scene is farther than a thousandth of the
system's size from a reference by another method in f64, `ias15` or `taylor` (for runs of these: each other). With `--repeats`
the price is measured instead: processor time of the whole program `run` with and without the search, in turns. `--share`
and `--least` change the work that the search may take, which shows how good extrapolated times are.
"""

import argparse
import os
import statistics
import subprocess
import sys
import time as clock
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2])]  # so that it also runs from a checkout

from mpp_taichi.errors import MppError  # noqa: E402
from mpp_taichi.horizon.horizon import LIMIT  # noqa: E402
from mpp_taichi.horizon.search import find  # noqa: E402
from mpp_taichi.horizon.work_budget import LEAST_WORK, SHARE  # noqa: E402
from mpp_taichi.scene.load import load_scene  # noqa: E402
from mpp_taichi.simulation.simulation import Simulation  # noqa: E402

BUNDLED, TARGETS = Path(__file__).parents[2] / "scenes", Path(__file__).with_name("target_scenes")
LOOKS = 800
# name: (scene, precision, changes)
SCENES = {
    "kepler": (BUNDLED / "kepler.yaml", "f64", []),
    "kepler_long": (BUNDLED / "kepler.yaml", "f64", ["run.duration=1500"]),
    "kepler_coarse": (BUNDLED / "kepler.yaml", "f64", ["integrator={leapfrog: {dt: 0.05}}", "run.duration=628"]),
    "kepler_rk4": (BUNDLED / "kepler.yaml", "f64", ["integrator={rk4: {dt: 0.05}}", "run.duration=2000"]),
    "kepler_yoshida8_f32": (BUNDLED / "kepler.yaml", "f32", ["integrator={yoshida8: {dt: 0.05}}", "run.duration=20000"]),
    "double_pendulum": (BUNDLED / "double_pendulum.yaml", "f64", []),
    "double_pendulum_long": (BUNDLED / "double_pendulum.yaml", "f64", ["run.duration=100"]),
    "double_pendulum_f32": (BUNDLED / "double_pendulum.yaml", "f32", ["run.duration=100"]),
    "stiff": (BUNDLED / "double_pendulum.yaml", "f64", ["integrator={rk4: {dt: 0.004}}", "run.duration=40"]),
    "figure_eight_long": (BUNDLED / "figure_eight.yaml", "f64", ["integrator={leapfrog: {dt: 0.01}}", "run.duration=300"]),
    "figure_eight_f32": (BUNDLED / "figure_eight.yaml", "f32", ["run.duration=600"]),
    "outer_solar_system": (BUNDLED / "outer_solar_system.yaml", "f64", []),
    "outer_planets_leapfrog": (
        BUNDLED / "outer_solar_system.yaml",
        "f64",
        ["integrator={leapfrog: {dt: 50}}", "run.duration=900000"],
    ),
    "solar_system": (BUNDLED / "solar_system.yaml", "f64", ["integrator={leapfrog: {dt: 0.5}}", "run.duration=3650"]),
    "membrane": (BUNDLED / "membrane.yaml", "f64", ["run.duration=200"]),
    "chain": (BUNDLED / "chain.yaml", "f64", []),
    "rope": (BUNDLED / "rope.yaml", "f64", []),
    "cluster": (BUNDLED / "cluster.yaml", "f64", []),
    "small_cluster": (BUNDLED / "cluster.yaml", "f64", ["particles[0].plummer.count=16", "run.duration=40"]),
    "cloth": (BUNDLED / "cloth.yaml", "f64", []),
    "membrane_release": (BUNDLED / "membrane_release.yaml", "f64", []),
    **{
        f"{name}_{method}": (TARGETS / f"{name}.yaml", "f64", [f"integrator={{{method}: {step}}}"])
        for name, method, step in (
            ("pythagorean", "taylor", "{}"),
            ("pythagorean", "ias15", "{}"),
            ("pythagorean", "leapfrog", "{dt: 0.0001}"),
            ("triple", "leapfrog", "{dt: 0.002}"),
            ("scene_d", "leapfrog", "{dt: 0.001}"),
            ("ions", "rk4", "{dt: 0.01}"),
            ("swarm", "leapfrog", "{dt: 0.002}"),
            ("trojan", "yoshida4", "{dt: 0.05}"),
        )
    },
}


def loaded(scene, changes):
    """The scene with changes, without a target for its error."""
    return replace(load_scene(scene, overrides=changes), accuracy=None)


def path_of(scene, precision, changes, until):
    """Positions at LOOKS + 1 evenly spaced times, (LOOKS + 1, particle_count, 3)."""
    with Simulation(loaded(scene, changes), backend="cpu", precision=precision) as simulation:
        found = [simulation.snapshot().position]
        for k in range(1, LOOKS + 1):
            ahead = until * k / LOOKS - simulation.time
            steps = max(0, round(ahead / simulation.dt))
            if simulation.integrator.controlled_by:
                simulation.run(until=until * k / LOOKS)
            elif steps:
                simulation.run(steps=steps)
            found.append((simulation.time, simulation.snapshot().position))
        return found[1:]


def reference_path(scene, changes, times, method):
    """Positions at the given times by an adaptive method in f64."""
    changes = [*(each for each in changes if not each.startswith("integrator=")), f"integrator={{{method}: {{}}}}"]
    with Simulation(loaded(scene, changes), backend="cpu", precision="f64") as simulation:
        found = []
        for time in times:
            if time > simulation.time:
                simulation.run(until=time)
            found.append(simulation.snapshot().position)
        return np.array(found)


def true_time(scene, precision, changes, until):
    """The first time at which the error reaches LIMIT, None where it does not, and the largest error."""
    path = path_of(scene, precision, changes, until)
    times, own = np.array([time for time, _ in path]), np.array([place for _, place in path])
    methods = ("taylor",) if any("ias15" in each for each in changes) else ("ias15", "taylor")
    for method in methods:
        try:
            reference = reference_path(scene, changes, times, method)
            break
        except MppError as error:
            problem = error
    else:
        raise problem
    size = np.sqrt(np.mean(np.sum((own - own.mean(axis=(0, 1))) ** 2, axis=-1)))
    errors = np.linalg.norm(own - reference, axis=-1).max(axis=1) / size
    above = np.flatnonzero(~(errors < LIMIT))
    return (float(times[above[0]]) if len(above) else None), float(np.nanmax(errors))


def main():
    """Print a row for each scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--share", type=float, default=SHARE)
    parser.add_argument("--least", type=float, default=LEAST_WORK)
    parser.add_argument("--repeats", type=int, default=0)
    parser.add_argument("--no-truth", action="store_true")
    asked = parser.parse_args()
    for name in asked.scenes.split(","):
        if asked.repeats:
            without, with_it = price(name, asked.repeats)
            print(f"{name:24s} without {without:.3f} s, with {with_it:.3f} s, ratio {with_it / without:.3f}", flush=True)
            continue
        scene, precision, changes = SCENES[name]
        try:
            told, seconds, run = search(scene, precision, changes, asked)
            until = told.end
            true, error = (None, float("nan")) if asked.no_truth else true_time(scene, precision, changes, until)
        except MppError as error:
            print(f"{name:24s} {str(error).splitlines()[0]}", flush=True)
            continue
        ratio = f"{told.time / true:.2f}" if told.time is not None and true is not None else "–"
        number = "–" if told.time is None else f"{told.time:.5g}"
        truth = "to the end" if true is None else f"{true:.5g}"
        print(
            f"{name:24s} {told.found:13s} told {number:>8s} true {truth:>10s} ratio {ratio:>5s} by {told.by} end {until:g} "
            f"true error {error:.1e} part {told.part:.3f} share {told.share:.3f}; {1e3 * seconds:.1f} ms, "
            f"run {1e3 * run:.1f} ms {told.reason}",
            flush=True,
        )


def search(scene, precision, changes, asked):
    """The horizon, the processor time of the search, and of the run."""
    with Simulation(loaded(scene, changes), backend="cpu", precision=precision) as simulation:
        until = simulation.spec.run.duration or simulation.spec.run.steps * simulation.dt
        found = find(simulation, until, asked.share, least=asked.least)  # compiles the kernels
        began = clock.process_time()
        find(simulation, until, asked.share, least=asked.least)
        searched = clock.process_time()
        simulation.run(until=until)
        return found, searched - began, clock.process_time() - searched


def price(name, repeats):
    """Medians of the processor time of the whole program without and with the search, in turns [s]."""
    scene, precision, changes = SCENES[name]
    given = [word for change in changes for word in ("--set", change)]
    command = [sys.executable, "-m", "mpp_taichi", "run", scene, "--headless", "-q", "--allow-inaccurate"]
    seconds = {"false": [], "true": []}
    for _ in range(repeats + 1):  # the first turn fills the caches of the compiler
        for wanted, taken in seconds.items():
            before = os.times()
            wishes = ["--precision", precision, "--set", f"horizon={wanted}"]
            subprocess.run([*command, *given, *wishes], capture_output=True, check=False)
            after = os.times()
            taken.append(after.children_user + after.children_system - before.children_user - before.children_system)
    return [statistics.median(taken[1:]) for taken in seconds.values()]


if __name__ == "__main__":
    main()
