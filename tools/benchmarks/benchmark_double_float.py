"""Which error of the positions each precision leaves, and what its step costs, on five kinds of motion and on two backends.

    python tools/benchmarks/benchmark_double_float.py [--problems kepler,cluster] [--backends cpu,vulkan]
        [--precisions f32,df64] [--repeats 9] [--json FILE]

Scenes of the program, each for about one orbit, one period or one crossing time, by `kahan_li8` with so many steps that the
method itself leaves less than 10⁻¹³ (the row of f64 shows it). The error is the largest of a particle at the end, relative to
the size of the system, against extrapolated steps in long double that share no code with the program
(long_double_reference.py). A time is processor time of all threads, which other programs hardly change; Vulkan in software
computes on these threads as well. Every precision on every backend lives in a process of its own; they take turns, and a ratio
is the median over the ratios of neighbouring samples to those of f32 on the same backend. The bar is that of df64: 10⁻¹².
"""

import argparse
import multiprocessing
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout that is not installed

from long_double_reference import reference_end  # noqa: E402
from verdicts import finish  # noqa: E402

SCENES, TARGETS = ROOT / "scenes", ROOT / "tools" / "benchmarks" / "target_scenes"
METHOD = "kahan_li8"
TAU = 2.0 * np.pi
# name: (scene, changes, time, steps)
PROBLEMS = {
    "kepler": (SCENES / "kepler.yaml", [], TAU, 400),
    "figure eight": (SCENES / "figure_eight.yaml", [], 6.32591398, 400),
    "outer planets, 12 years": (SCENES / "outer_solar_system.yaml", [], 4332.589, 100),
    "outer planets, 248 years": (SCENES / "outer_solar_system.yaml", [], 90650.0, 2000),
    "membrane of springs": (SCENES / "membrane.yaml", [], 2.445, 200),
    "falling net of damped springs": (TARGETS / "falling_net.yaml", [], 1.0, 400),
    "cluster of 64 stars": (SCENES / "cluster.yaml", ["particles[0].plummer.count=64"], 3.0, 600),
}
PRECISIONS = ("f32", "f32c", "ds", "df64", "f64")
TARGET = 1e-12
LOOKS = 50  # at the places of a run, for the size of the system
SAMPLE = 0.05  # seconds of a timed loop, at least a step


def loaded(name):
    """The scene of a problem with the method of this benchmark."""
    from mpp_taichi.scene.load import load_scene

    path, changes, span, steps = PROBLEMS[name]
    step = f"integrator={{{METHOD}: {{dt: {span / steps!r}}}}}"
    return load_scene(path, overrides=[*changes, step, f"run.duration={span!r}"])


def reference(name):
    """Positions at the end in long double, and the size: as everywhere, of the moving particles over the whole run."""
    from mpp_taichi.horizon.contact_search import size_of
    from mpp_taichi.simulation.simulation import Simulation
    from mpp_taichi.start.assemble import assemble

    spec, (_, _, span, steps) = loaded(name), PROBLEMS[name]
    start, path = assemble(spec), []
    with Simulation(spec, backend="cpu", precision="f64") as simulation:
        for _ in range(LOOKS):
            simulation.run(steps=steps // LOOKS, judge="off")
            path.append(simulation.snapshot().position[start.free.any(axis=1)])
    return reference_end(spec, start, span), size_of(np.array(path))


def work(pipe, name, backend, precision):
    """Hold one simulation and do as the parent says: the positions at the end, or processor time of a step."""
    from mpp_taichi import Simulation
    from mpp_taichi.device.backends import import_taichi
    from mpp_taichi.errors import MppError

    steps = PROBLEMS[name][3]
    try:
        simulation = Simulation(loaded(name), backend=backend, precision=precision)
    except MppError as error:
        pipe.send(str(error))
        return
    with simulation:
        synchronise, dt = import_taichi().sync, simulation.dt
        simulation.run(steps=1)
        pipe.send((simulation.device.name, simulation.plan))
        while (count := pipe.recv()) is not None:
            simulation.restart()
            if not count:
                pipe.send(simulation.run(steps=steps, judge="off").snapshot().position)
                continue
            simulation.launcher.prepare(0.0, dt)
            simulation.launcher.advance(0.0, dt, 0, 1)
            synchronise()
            began = time.process_time()
            simulation.launcher.advance(0.0, dt, 0, count)
            synchronise()
            pipe.send((time.process_time() - began) / count)


def measure(name, backend, precisions, repeats, end, size):
    """Errors, and medians of the times, of all precisions on a backend that starts; else the reason."""
    context = multiprocessing.get_context("spawn")  # Taichi does not survive a fork
    pipes, children, rows, seconds = {}, [], {}, {}
    for precision in precisions:
        ours, theirs = context.Pipe()
        children.append(context.Process(target=work, args=(theirs, name, backend, precision), daemon=True))
        children[-1].start()
        told = ours.recv()
        if isinstance(told, str):
            rows[precision] = {"refused": told}
            continue
        pipes[precision], seconds[precision] = ours, []
        ours.send(0)
        error = np.linalg.norm((ours.recv() - end).astype(float), axis=1).max() / size
        rows[precision] = {"error": float(error), "device": told[0], "plan": told[1]}

    def ask(precision, count):
        pipes[precision].send(count)
        return pipes[precision].recv()

    counts = {precision: max(1, min(20_000, int(SAMPLE / ask(precision, 1)))) for precision in pipes}
    for repeat in range(repeats):
        order = list(pipes)
        turn = repeat % len(order)
        for precision in order[turn:] + order[:turn]:
            seconds[precision].append(ask(precision, counts[precision]))
    for precision, pipe in pipes.items():
        ratios = np.divide(seconds[precision], seconds["f32"])
        low, median, high = np.percentile(ratios, [25, 50, 75])
        rows[precision] |= {"seconds": float(np.median(seconds[precision])), "ratio": median, "quartiles": [low, high]}
        pipe.send(None)
    for child in children:
        child.join()
    return rows


def show(name, backend, rows):
    """A line for each precision."""
    for precision, row in rows.items():
        where = f"{name:30s}{backend:8s}{precision:6s}"
        if "refused" in row:
            print(f"{where}refused: {row['refused']}", flush=True)
        else:
            print(f"{where}{row['error']:10.1e}{row['seconds'] * 1e6:12,.4g} µs{row['ratio']:9.3g}", flush=True)


def main():
    """Measure, print, write; 1 where df64 misses its bar."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", default=",".join(PROBLEMS).replace(", ", "; "))
    parser.add_argument("--backends", default="cpu,vulkan")
    parser.add_argument("--precisions", default=",".join(PRECISIONS), help="among them f32 and df64")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    print(f"{'problem':30s}{'backend':8s}{'':6s}{'error':>10s}{'step':>15s}{'÷ f32':>9s}")
    precisions = arguments.precisions.split(",")
    if not {"f32", "df64"} <= set(precisions):
        parser.error("--precisions needs f32 and df64")
    results, verdicts, machine = {}, [], {}
    for name in (each.replace("; ", ", ") for each in arguments.problems.split(",")):
        end, size = reference(name)
        for backend in arguments.backends.split(","):
            rows = results.setdefault(name, {})[backend] = measure(name, backend, precisions, arguments.repeats, end, size)
            show(name, backend, rows)
            machine[backend] = next((row["device"] for row in rows.values() if "device" in row), None)
            error = rows["df64"].get("error", float("inf"))
            verdicts.append((f"{name} on {backend}: error of df64, at most", error, TARGET, error <= TARGET))
    return finish(verdicts, results, arguments.json, devices=machine)


if __name__ == "__main__":
    raise SystemExit(main())
