"""Does `resting` end any scene of many contacts? Random piles and scenes, by their seeds, with physics as the judge.

    python tools/checks/contact_seeds.py piles [--count 1000] [--first 0] [--steps 1000] [--dt 0.01] [--parallel] [--part 1/2]
    python tools/checks/contact_seeds.py board|hourglass|struck_wall|column|press [--count 1] [--dt …] [--restitution …]

Both take --precision f64 or f32, and the scenes --backend, --duration and --tolerance.

A seed fails if a contact is not resolved, if a sphere overlaps another sphere or a surface by more than `OVERLAP` of a radius,
or if the contacts of some steps give kinetic energy: more than `GAIN` of the energy of the start, which is what the tolerance
of the contacts leaves. Prints the seeds that failed, and their number of all; 1 where there are any.
"""

import argparse
import itertools
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]  # so that it also runs from a checkout that is not installed

import contact_scenes  # noqa: E402

from mpp_taichi.device import backends  # noqa: E402
from mpp_taichi.errors import StabilityError  # noqa: E402
from mpp_taichi.simulation.simulation import Simulation  # noqa: E402

OVERLAP = {"f64": 1e-8, "f32": 2e-3}
GAIN = {"f64": 1e-8, "f32": 1e-3}
LOOK = 50  # steps between two looks
SCENES = {
    "board": contact_scenes.galton_board,
    "hourglass": contact_scenes.hourglass,
    "struck_wall": contact_scenes.struck_wall,
    "column": contact_scenes.column,
    "press": contact_scenes.press,
}


def piles(options):
    """Numbers of the seeds that failed."""
    from random_piles import RandomPiles  # it imports Taichi, behind the settings of the package

    backends.start("cpu", options.precision)
    failed = []
    kinds = list(itertools.product((2, 3), ("box", "slope"), (0.0, 0.4, 0.8, 1.0)))
    part, parts = map(int, options.part.split("/"))
    tried = 0
    for number in range(len(kinds) * (part - 1) // parts, len(kinds) * part // parts):
        dimensions, kind, restitution = kinds[number]
        made = RandomPiles(dimensions, kind, restitution, parallel=True if options.parallel else None)
        began, counted = time.process_time(), 0
        for seed in range(options.first + number, options.first + options.count, len(kinds)):
            made.place(seed)
            counted, tried = counted + 1, tried + 1
            trouble = _run_pile(made, options)
            if trouble:
                failed.append(seed)
                print(f"seed {seed}: {trouble}", flush=True)
        spent = time.process_time() - began
        print(
            f"{dimensions}D {kind}, restitution {restitution}: {counted} seeds, {spent:.0f} s; {len(failed)} failed", flush=True
        )
        made.solver.destroy()
    print(f"{len(failed)} of {tried} seeds failed: {failed}")
    return len(failed)


def _run_pile(made, options):
    """Why a pile failed, or nothing."""
    start = made.energy()
    for step in range(options.steps):
        made.step(step, options.dt)
        if step % LOOK == LOOK - 1:
            report = made.solver.collect()
            if report.unresolved:
                return f"step {step + 1}: {made.solver.failure(report.unresolved)}"
            if report.largest_overlap > OVERLAP[options.precision]:
                return f"step {step + 1}: an overlap of {report.largest_overlap:.2g} radii"
            if report.dissipated_energy < -GAIN[options.precision] * abs(start):
                return f"step {step + 1}: contacts give the energy {-report.dissipated_energy:.2g}, of {start:.2g}"
    return ""


def scenes(options):
    """Number of the scenes that ended, or whose contacts gave energy."""
    failed = 0
    more = {name: getattr(options, name) for name in ("dt", "restitution", "duration", "tolerance") if getattr(options, name)}
    for seed in range(options.first, options.first + options.count):
        scene = SCENES[options.kind](seed=seed, **more)
        simulation = Simulation(scene, backend=options.backend, precision=options.precision)
        start = sum(contact_scenes.energies(simulation.snapshot()))
        began, trouble = time.process_time(), ""
        try:
            simulation.run()
        except StabilityError as error:
            trouble = str(error)
        report = simulation.contact_report
        if not trouble and report.largest_overlap > OVERLAP[options.precision]:
            trouble = "overlap"
        kinetic, height = contact_scenes.energies(simulation.snapshot())
        failed += bool(trouble)
        print(
            f"{options.kind} {more}, seed {seed}: {trouble or 'ok'}; {report.pair_count} collisions, largest overlap "
            f"{report.largest_overlap:.2g} radii, energy {start:.6g} to {kinetic + height:.6g}, kinetic {kinetic:.3g}; "
            f"{time.process_time() - began:.0f} s",
            flush=True,
        )
        simulation.close()
    print(f"{failed} of {options.count} failed")
    return failed


def main():
    """1 where anything failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=["piles", *SCENES])
    parser.add_argument("--count", type=int, default=None)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--dt", type=float)
    parser.add_argument("--restitution", type=float)
    parser.add_argument("--duration", type=float)
    parser.add_argument("--tolerance", type=float)
    parser.add_argument("--precision", choices=["f64", "f32"], default="f64")
    parser.add_argument("--backend", default="cpu")
    parser.add_argument("--parallel", action="store_true")
    parser.add_argument("--part", default="1/1", help="of the kinds of piles, for several processes beside each other")
    options = parser.parse_args()
    if options.kind == "piles":
        options.count, options.dt = options.count or 1000, options.dt or 0.01
        return 1 if piles(options) else 0
    options.count = options.count or 1
    return 1 if scenes(options) else 0


if __name__ == "__main__":
    raise SystemExit(main())
