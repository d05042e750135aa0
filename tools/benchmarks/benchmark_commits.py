"""Is this checkout as fast as another one? The same runs in both, in turns, in one go.

    git worktree add /tmp/before COMMIT
    python tools/benchmarks/benchmark_commits.py /tmp/before [--only springs …] [--repeats 15] [--json FILE]

A process for each checkout holds the run compiled. The parent process asks them for the same run in turns, A B B A, so that a
machine whose speed drifts drifts for both. A figure is the median of the ratios of neighbouring runs; the bar is 1.03.
The cold start is that of `sun_earth` in a new process with empty caches.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
BAR = 1.03  # time of this checkout ÷ time of the other
SAMPLE_SECONDS = 0.25  # of one run: long beside a timer's and a scheduler's noise
GRAVITY = {"newtonian_gravity": {"strength": 1.0, "softening": 0.05}}
CROWD = {"dimensions": 3, "seed": 5, "forces": [GRAVITY], "integrator": {"leapfrog": {"dt": 1e-4}}}
TREE = {"newtonian_gravity": {"strength": 1.0, "softening": 0.05, "solver": "tree"}}


def gas(count, solver, **more):
    """Spheres in a periodic box of packing 0.3."""
    edge = 10.0
    radius = (0.3 * edge**3 / count / (4 / 3 * np.pi)) ** (1 / 3)
    return {
        "dimensions": 3,
        "seed": 7,
        "particles": [{"gas": {"count": count, "lower": [0] * 3, "upper": [edge] * 3, "radius": float(radius), "speed": 1.0}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "walls": [{"box": {"lower": [0] * 3, "upper": [edge] * 3}}],
        "integrator": {"event_driven": {"dt": 0.01}} if solver == "event_driven" else {"leapfrog": {"dt": 0.1 * float(radius)}},
        **more,
    }


def sheet(side, *, damping=0.0):
    """A crumpled sheet of side × side masses, with some 4 springs for each mass."""
    spring = {"stiffness": 50.0, "damping": damping}
    lattice = {"name": "sheet", "shape": [side, side], "lower": [0, 0, 0], "upper": [side - 1, side - 1, 0], "mass": 1.0}
    return {
        "dimensions": 3,
        "seed": 3,
        "particles": [{"lattice": {**lattice, "scatter": [0.2, 0.2, 0.2]}}],
        "springs": [{"lattice_links": {"of": "sheet", **spring, **more}} for more in ({}, {"neighbors": "diagonal"})],
        "integrator": {"leapfrog": {"dt": 0.01}},
    }


def crowd(count, **more):
    """Bodies of a star cluster."""
    return {**CROWD, "particles": [{"plummer": {"count": count}}], **more}


def runs():
    """Name: scene, precision."""
    bundled = ROOT / "scenes"
    return {
        "2 bodies f64": (crowd(2), "f64"),
        "9 bodies f64": (crowd(9), "f64"),
        "64 bodies f64": (crowd(64), "f64"),
        "2048 bodies f64": (crowd(2048), "f64"),
        "8192 bodies f32": (crowd(8192), "f32"),
        "tree 30000 bodies f32": (crowd(30000, forces=[TREE]), "f32"),
        "tree 3000 bodies f32": (crowd(3000, forces=[TREE]), "f32"),
        "tree 3000 bodies f64": (crowd(3000, forces=[TREE]), "f64"),
        "sheet of 4096 springs f64": (sheet(33), "f64"),
        "sheet of 65536 springs f32": (sheet(129), "f32"),
        "sheet of 65536 springs f64": (sheet(129), "f64"),
        "sheet of a million springs f32": (sheet(501), "f32"),
        "damped sheet of a million springs f64": (sheet(501, damping=0.1), "f64"),
        "membrane f64": (str(bundled / "membrane.yaml"), "f64"),
        "cloth f32": (str(bundled / "cloth.yaml"), "f32"),
        "ring f32": (str(bundled / "ring.yaml"), "f32"),
        "ring f64": (str(bundled / "ring.yaml"), "f64"),
        "stiff pendulum f64": (str(bundled / "stiff_pendulum.yaml"), "f64"),
        "ias15 kepler16 f64": (str(bundled / "kepler16_ejected.yaml"), "f64"),
        "outer solar system f64": (str(bundled / "outer_solar_system.yaml"), "f64"),
        "swept 20000 spheres f64": (gas(20000, "swept"), "f64"),
        "pairwise 20000 spheres f32": (gas(20000, "pairwise"), "f32"),
        "pairwise 64000 spheres f64": (gas(64000, "pairwise"), "f64"),
        "event-driven 10000 spheres f64": (gas(10000, "event_driven"), "f64"),
        "pile f64": (str(bundled / "pile.yaml"), "f64"),
    }


WORKER = """
import json, sys, time
sys.path.insert(0, sys.argv[1])
import mpp_taichi as mpp
ready = {}
for line in sys.stdin:
    name, scene, precision, steps = json.loads(line)
    if name in ready:
        simulation = ready[name]
    else:
        for other in ready.values():
            other.close()
        ready.clear()
        simulation = ready[name] = mpp.Simulation(scene, backend="cpu", precision=precision)
        simulation.run(steps=1)
    began = time.perf_counter()
    simulation.run(steps=steps)
    print("seconds", time.perf_counter() - began, flush=True)
"""


class Checkout:
    """A process that runs scenes with the package of one checkout."""

    def __init__(self, folder):
        """Start it."""
        environment = dict(os.environ, PYTHONPATH=str(folder))
        self.process = subprocess.Popen(
            [sys.executable, "-c", WORKER, str(folder)],
            cwd=folder,
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    def seconds(self, name, scene, precision, steps):
        """How long so many steps take."""
        print(json.dumps([name, scene, precision, steps]), file=self.process.stdin, flush=True)
        for line in self.process.stdout:
            if line.startswith("seconds"):
                return float(line.split()[1])
        raise SystemExit(f"{name} ended with code {self.process.wait()}")

    def close(self):
        """End it."""
        self.process.stdin.close()
        self.process.wait()


def compare(here, there, name, scene, precision, repeats):
    """Steps of a sample, median seconds of both checkouts, and the ratios of neighbouring runs."""
    steps = 1
    for checkout in (here, there):
        checkout.seconds(name, scene, precision, steps)
    while (taken := here.seconds(name, scene, precision, steps)) < SAMPLE_SECONDS / 2 and steps < 10**7:
        steps = int(steps * min(100.0, SAMPLE_SECONDS / max(taken, 1e-5))) + 1
    there.seconds(name, scene, precision, steps)
    ours, theirs = [], []
    for repeat in range(repeats):
        for checkout, list_ in ((here, ours), (there, theirs))[:: 1 if repeat % 2 else -1]:
            list_.append(checkout.seconds(name, scene, precision, steps))
    ratios = np.array(ours) / np.array(theirs)
    return {
        "steps": steps,
        "seconds": float(np.median(ours)) / steps,
        "seconds_before": float(np.median(theirs)) / steps,
        "ratio": float(np.median(ratios)),
        "spread": float(np.subtract(*np.percentile(ratios, [75, 25]))),
    }


def cold_start(folder):
    """Seconds of a new process with empty caches, from its start to one step."""
    code = "import mpp_taichi as mpp; s = mpp.Simulation('scenes/sun_earth.yaml', backend='cpu'); s.run(steps=1)"
    with tempfile.TemporaryDirectory() as home:
        environment = dict(os.environ, HOME=home, XDG_CACHE_HOME=home, PYTHONPATH=str(folder))
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # a new process of an installed package finds its bytecode
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, check=True, capture_output=True)
        return time.perf_counter() - began


def main():
    """Measure, print the table, write the JSON; the exit code is 1 where the bar is not held."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("other", type=Path, help="the checkout to compare with")
    parser.add_argument("--only", nargs="+", default=[""], help="runs whose names hold one of these texts")
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    here, there, other = Checkout(ROOT), Checkout(options.other.resolve()), options.other.resolve()
    found = {}
    print(f"{'run':32} {'a step here':>12} {'there':>12} {'ratio':>7} {'quartiles':>9}")
    for name, (scene, precision) in runs().items():
        if any(text in name for text in options.only):
            row = found[name] = compare(here, there, name, scene, precision, options.repeats)
            print(
                f"{name:32} {row['seconds'] * 1e6:9.3f} µs {row['seconds_before'] * 1e6:9.3f} µs {row['ratio']:7.3f} "
                f"{row['spread']:9.3f}",
                flush=True,
            )
    here.close()
    there.close()
    if any(text in "cold start" for text in options.only):
        pairs = np.array([[cold_start(ROOT), cold_start(other)] for _ in range(5)])
        ratio = float(np.median(pairs[:, 0] / pairs[:, 1]))
        found["cold start"] = {
            "seconds": float(np.median(pairs[:, 0])),
            "seconds_before": float(np.median(pairs[:, 1])),
            "ratio": ratio,
        }
        print(f"{'cold start':32} {np.median(pairs[:, 0]):10.2f} s {np.median(pairs[:, 1]):10.2f} s {ratio:7.3f}")
    slower = [name for name, row in found.items() if row["ratio"] > BAR]
    print(f"\nslower than {BAR} of the other: {', '.join(slower) or 'none'}")
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
